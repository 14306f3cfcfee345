//! The panels over the mirror: the window's events go in, pictures come out, at their own pace.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use egui::{Pos2, ViewportId, pos2};
use winit::event::{DeviceId, Modifiers, WindowEvent};
use winit::window::Window;

use crate::panels::{Outcome, Painted, Panels};

/// From one picture to the next at least, while a person is at work in the panels, and where only numbers change.
const QUICKEST: Duration = Duration::from_millis(16);
const USUAL: Duration = Duration::from_millis(66);

/// When the panels are laid out: not for every frame, which shows the last picture of them in between.
#[derive(Clone, Copy, Debug)]
struct Pace {
    last: Instant,
    due: Instant,
}

impl Pace {
    fn is_due(&self, now: Instant) -> bool {
        now >= self.due
    }

    /// They were laid out, and would look different by themselves after so long.
    fn laid_out(&mut self, now: Instant, again_in: Duration) {
        *self = Pace { last: now, due: now + again_in.clamp(QUICKEST, USUAL) };
    }

    /// Somebody has moved or pressed something.
    fn hurry(&mut self) {
        self.due = self.due.min(self.last + QUICKEST);
    }
}

/// What the window's thread and the flight's share.
#[derive(Default)]
pub(super) struct Canvas {
    shown: AtomicBool,
    /// The last picture, until the flight takes it.
    painted: Mutex<Option<Painted>>,
}

impl Canvas {
    pub(super) fn is_shown(&self) -> bool {
        self.shown.load(Ordering::Relaxed)
    }

    pub(super) fn take(&self) -> Option<Painted> {
        self.painted.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn put(&self, painted: Painted) {
        *self.painted.lock().unwrap_or_else(PoisonError::into_inner) = Some(painted);
    }
}

/// The window's end of the panels.
pub(super) struct Overlay {
    panels: Panels,
    state: Option<egui_winit::State>,
    canvas: Arc<Canvas>,
    /// The cursor, in the window's pixels.
    cursor: Option<Pos2>,
    /// Shift, Ctrl, Alt as they were last heard of.
    modifiers: Modifiers,
    pace: Pace,
}

impl Overlay {
    pub(super) fn new(panels: Panels) -> Overlay {
        let now = Instant::now();
        let pace = Pace { last: now, due: now };
        let modifiers = Modifiers::default();
        Overlay { panels, state: None, canvas: Arc::default(), cursor: None, modifiers, pace }
    }

    pub(super) fn canvas(&self) -> Arc<Canvas> {
        Arc::clone(&self.canvas)
    }

    pub(super) fn is_shown(&self) -> bool {
        self.canvas.is_shown()
    }

    /// Shows the panels, or hides them: then nothing of them is at work.
    pub(super) fn toggle(&mut self, window: &Window) {
        if self.is_shown() {
            self.leave(window);
            self.canvas.shown.store(false, Ordering::Relaxed);
            self.canvas.take();
        } else {
            let context = self.panels.context().clone();
            let state = self.state.get_or_insert_with(|| {
                egui_winit::State::new(context, ViewportId::ROOT, window, None, window.theme(), None)
            });
            // What has happened since they were hidden: nothing is pressed, and all is as it is now.
            let _ = state.on_window_event(window, &WindowEvent::ModifiersChanged(self.modifiers));
            let _ = state.on_window_event(window, &WindowEvent::Focused(window.has_focus()));
            self.paint(window);
            self.canvas.shown.store(true, Ordering::Relaxed);
        }
    }

    /// The cursor is nowhere any more: it is taken, or the panels are hidden.
    pub(super) fn leave(&mut self, window: &Window) {
        self.cursor = None;
        if let Some(state) = self.state.as_mut().filter(|_| self.canvas.is_shown()) {
            let _ = state.on_window_event(window, &WindowEvent::CursorLeft { device_id: DeviceId::dummy() });
        }
    }

    /// Keeps what has to be known of an event when the panels are shown again.
    pub(super) fn remember(&mut self, event: &WindowEvent) {
        if let WindowEvent::ModifiersChanged(modifiers) = event {
            self.modifiers = *modifiers;
        }
    }

    /// Hears of an event, while the panels are shown. True if it is meant for them alone.
    pub(super) fn takes(&mut self, window: &Window, event: &WindowEvent) -> bool {
        let Some(state) = self.state.as_mut().filter(|_| self.canvas.is_shown()) else { return false };
        let response = state.on_window_event(window, event);
        if response.repaint {
            self.pace.hurry();
        }
        match event {
            WindowEvent::CursorMoved { position, .. } => {
                self.cursor = Some(pos2(position.x as f32, position.y as f32));
                response.consumed || self.is_under(window)
            }
            WindowEvent::CursorLeft { .. } => {
                self.cursor = None;
                false
            }
            WindowEvent::MouseInput { .. } | WindowEvent::MouseWheel { .. } => {
                response.consumed || self.is_under(window)
            }
            WindowEvent::KeyboardInput { .. } => response.consumed,
            _ => false,
        }
    }

    /// The cursor is over a panel.
    fn is_under(&self, window: &Window) -> bool {
        let scale = egui_winit::pixels_per_point(self.panels.context(), window);
        self.cursor.is_some_and(|pixels| self.panels.covers(pixels / scale))
    }

    /// Paints, where it is time to; when it will be again. None while the panels are hidden.
    pub(super) fn tend(&mut self, window: &Window) -> Option<Instant> {
        if !self.is_shown() {
            return None;
        }
        if self.pace.is_due(Instant::now()) {
            self.paint(window);
        }
        Some(self.pace.due)
    }

    fn paint(&mut self, window: &Window) {
        let now = Instant::now();
        self.pace.laid_out(now, USUAL);
        let size = window.inner_size();
        let Some(state) = self.state.as_mut().filter(|_| size.width > 0 && size.height > 0) else { return };
        let input = state.take_egui_input(window);
        let Outcome { painted, output, again_in } = self.panels.paint(input, [size.width, size.height]);
        state.handle_platform_output(window, output);
        self.canvas.put(painted);
        self.pace.laid_out(now, again_in);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Layouts in ten seconds of frames at 60 Hz, of which each asks whether it is time, and `happens` in each.
    fn layouts(again_in: Duration, happens: impl Fn(&mut Pace)) -> u32 {
        let start = Instant::now();
        let mut pace = Pace { last: start, due: start };
        let mut layouts = 0;
        for frame in 0..600 {
            let now = start + Duration::from_micros(16_667 * frame);
            happens(&mut pace);
            if pace.is_due(now) {
                pace.laid_out(now, again_in);
                layouts += 1;
            }
        }
        layouts
    }

    #[test]
    fn a_layout_is_for_several_frames_unless_somebody_is_at_work() {
        assert_eq!(layouts(Duration::MAX, |_| ()), 150);
        assert_eq!(layouts(Duration::from_secs(3), |_| ()), 150);
        assert_eq!(layouts(Duration::MAX, Pace::hurry), 600);
        assert_eq!(layouts(Duration::ZERO, |_| ()), 600);
    }
}
