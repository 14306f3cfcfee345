//! EDGE: the desktop window: its events on the main thread, the flight on another, so that neither waits for the other.
//!
//! | file | noun |
//! |---|---|
//! | `controls` | keys and mouse, as [`Input`](crate::input::Input) |
//! | `pane` | which part of which eye's picture is seen where |
//! | `spectator` | a camera that turns after the eye smoothly |
//! | `compose` | the window's picture, drawn |
//! | `mirror` | and shown |
//! | `overlay` | the panels over it |

mod compose;
mod controls;
mod mirror;
mod overlay;
mod pane;
mod spectator;

pub use compose::{Composer, MIRROR_SHADER, PanePush, Scene};
pub use controls::{Controls, Hands};
pub use mirror::Mirror;
pub use pane::{Pane, SPECTATOR_SHARE, Side, Sights};
pub use spectator::Spectator;

use std::ffi::CStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Scope, ScopedJoinHandle};
use std::time::Duration;

use anyhow::{Context, Result, anyhow};
use raw_window_handle::HasDisplayHandle;
use winit::application::ApplicationHandler;
use winit::dpi::LogicalSize;
use winit::error::EventLoopError;
use winit::event::{DeviceEvent, DeviceId, ElementState, KeyEvent, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::{CursorGrabMode, Fullscreen, Window, WindowId};

use crate::gpu::{Gpu, surface_extension};
use crate::panels::{Painted, Panels};
use overlay::{Canvas, Overlay};

/// Size of the window at first, in logical pixels.
const SIZE: LogicalSize<f64> = LogicalSize::new(960.0, 600.0);

/// Where touchpads count pixels, so many are a notch of the wheel.
const PIXELS_PER_NOTCH: f32 = 40.0;

/// Longest wait for the window to go once the flight is over: a display that hangs does not even take that.
const PATIENCE: Duration = Duration::from_secs(5);

/// A display that a window can be opened on.
pub struct Display(EventLoop<News>);

/// What the flight tells the window.
enum News {
    Title(String),
    /// The flight is over.
    Ended,
}

/// The flight's end of the window.
pub struct Link {
    window: Arc<Window>,
    controls: Arc<Mutex<Controls>>,
    canvas: Arc<Canvas>,
    news: EventLoopProxy<News>,
}

impl Link {
    /// What is wanted in the next frame.
    pub fn hands(&self) -> Hands {
        lock(&self.controls, Controls::take)
    }

    /// The panels are shown.
    pub fn has_panels(&self) -> bool {
        self.canvas.is_shown()
    }

    /// A new picture of the panels, where there is one.
    pub fn painted(&self) -> Option<Painted> {
        self.canvas.take()
    }

    /// Words for the title bar.
    pub fn set_title(&self, title: String) {
        // Where the window has gone, nobody reads it.
        let _ = self.news.send_event(News::Title(title));
    }

    /// A mirror in the window, which has no other.
    ///
    /// # Errors
    /// A sentence that says why nothing can be shown there.
    pub fn mirror(&self, gpu: &Arc<Gpu>) -> Result<Mirror> {
        Mirror::new(gpu, &self.window)
    }
}

/// However the flight ends, the window must not stay.
struct Farewell(EventLoopProxy<News>);

impl Drop for Farewell {
    fn drop(&mut self) {
        let _ = self.0.send_event(News::Ended);
    }
}

fn lock<T>(controls: &Mutex<Controls>, with: impl FnOnce(&mut Controls) -> T) -> T {
    with(&mut controls.lock().unwrap_or_else(PoisonError::into_inner))
}

impl Display {
    /// The display of this environment; None where there is none. On the main thread, and once in a process.
    ///
    /// # Errors
    /// There is one, and it does not answer.
    pub fn open() -> Result<Option<Display>> {
        let is_named = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        if cfg!(all(unix, not(target_os = "macos")))
            && !["WAYLAND_DISPLAY", "WAYLAND_SOCKET", "DISPLAY"].into_iter().any(is_named)
        {
            return Ok(None);
        }
        match EventLoop::with_user_event().build() {
            Ok(events) => Ok(Some(Display(events))),
            Err(EventLoopError::NotSupported(_)) => Ok(None),
            Err(error) => Err(error).context("the display does not answer (`fathomless doctor` says more)"),
        }
    }

    /// The Vulkan extension for its windows.
    ///
    /// # Errors
    /// Vulkan does not know this platform.
    pub fn surface_extension(&self) -> Result<&'static CStr> {
        surface_extension(self.0.display_handle().context("the display is gone")?.as_raw())
    }

    /// Opens a window and runs `fly` beside it; F1 shows the panels there. Closing the window sets `stop`; it goes when
    /// `fly` has returned. Where it cannot even do that, since the display hangs, `hangs` gets what `fly` returned: it is to
    /// end the process.
    ///
    /// # Errors
    /// The window cannot be opened, or the display is lost; `fly` has then returned, too.
    pub fn run<T: Send>(
        self,
        title: &str,
        stop: &AtomicBool,
        panels: Panels,
        fly: impl FnOnce(Link) -> T + Send,
        hangs: impl FnOnce(&T) + Send,
    ) -> Result<T> {
        self.0.set_control_flow(ControlFlow::Wait);
        let news = self.0.create_proxy();
        let farewell = Farewell(news.clone());
        let (open, closed) = channel::<()>();
        let fly = move |link| {
            // Nothing of the window is left here when it is told to go.
            let flown = fly(link);
            drop(farewell);
            wait_closed(&closed, || hangs(&flown));
            flown
        };
        std::thread::scope(|scope| {
            let mut desktop = Desktop {
                scope,
                title,
                stop,
                news,
                fly: Some(fly),
                flight: None,
                window: None,
                failed: None,
                controls: Arc::default(),
                overlay: Overlay::new(panels),
            };
            let ran = self.0.run_app(&mut desktop);
            // If the display was lost, the flight still has to end.
            stop.store(true, Ordering::Relaxed);
            if let Some(error) = desktop.failed.take() {
                return Err(error);
            }
            let flight = desktop.flight.take().context("the window was never opened")?;
            drop((desktop, open));
            let flown = flight.join().map_err(|_| anyhow!("the flight ended by a fault of the program"))?;
            ran.context("the display was lost")?;
            Ok(flown)
        })
    }
}

/// Waits until the other end of a channel is gone, or else calls `hangs`.
fn wait_closed(closed: &Receiver<()>, hangs: impl FnOnce()) {
    if closed.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
        hangs();
    }
}

/// The window and what happens to it.
struct Desktop<'scope, 'env, F, T> {
    scope: &'scope Scope<'scope, 'env>,
    title: &'env str,
    stop: &'env AtomicBool,
    news: EventLoopProxy<News>,
    fly: Option<F>,
    flight: Option<ScopedJoinHandle<'scope, T>>,
    window: Option<Arc<Window>>,
    failed: Option<anyhow::Error>,
    controls: Arc<Mutex<Controls>>,
    overlay: Overlay,
}

impl<'scope, F, T> Desktop<'scope, '_, F, T>
where
    F: FnOnce(Link) -> T + Send + 'scope,
    T: Send + 'scope,
{
    fn open(&mut self, events: &ActiveEventLoop, fly: F) -> Result<()> {
        let attributes = Window::default_attributes().with_title(self.title).with_inner_size(SIZE);
        let window = Arc::new(events.create_window(attributes).context("cannot open a window")?);
        let size = window.inner_size();
        lock(&self.controls, |controls| controls.resize([size.width, size.height]));
        let link = Link {
            window: Arc::clone(&window),
            controls: Arc::clone(&self.controls),
            canvas: self.overlay.canvas(),
            news: self.news.clone(),
        };
        self.window = Some(window);
        self.flight = Some(self.scope.spawn(move || fly(link)));
        Ok(())
    }

    fn key(&mut self, key: KeyCode, state: ElementState) {
        if state == ElementState::Released {
            return lock(&self.controls, |controls| controls.release(key));
        }
        let taken = lock(&self.controls, |controls| {
            controls.press(key);
            controls.has_mouse()
        });
        match key {
            KeyCode::KeyF => self.take_mouse(!taken),
            KeyCode::Escape if taken => self.take_mouse(false),
            KeyCode::Escape => self.close(),
            KeyCode::F1 => self.toggle_panels(),
            KeyCode::F11 => self.toggle_full_screen(),
            _ => {}
        }
    }

    fn toggle_panels(&mut self) {
        if let Some(window) = &self.window {
            self.overlay.toggle(window);
        }
    }

    /// The panels keep an event for themselves: the flight hears of it only what it must.
    fn is_for_panels(&mut self, event: &WindowEvent) -> bool {
        let Some(window) = self.window.as_ref().filter(|_| self.overlay.is_shown()) else { return false };
        let on_keys_alone = matches!(
            event,
            WindowEvent::KeyboardInput {
                event: KeyEvent { physical_key: PhysicalKey::Code(KeyCode::F1), .. },
                ..
            }
        );
        // A mouse that looks around does not point.
        if on_keys_alone || lock(&self.controls, |controls| controls.has_mouse()) {
            return false;
        }
        let takes = self.overlay.takes(window, event);
        if takes {
            lock(&self.controls, |controls| match event {
                WindowEvent::CursorMoved { .. } => controls.point(None),
                WindowEvent::KeyboardInput {
                    event: KeyEvent { physical_key: PhysicalKey::Code(key), .. },
                    ..
                } => controls.release(*key),
                _ => {}
            });
        }
        takes
    }

    fn take_mouse(&mut self, take: bool) {
        let Some(window) = &self.window else { return };
        let grabbed = match take {
            // Not every system can hold it in place; within the window will do.
            true => window
                .set_cursor_grab(CursorGrabMode::Locked)
                .or_else(|_| window.set_cursor_grab(CursorGrabMode::Confined)),
            false => window.set_cursor_grab(CursorGrabMode::None),
        };
        if let Err(error) = grabbed {
            tracing::debug!("the mouse stays free: {error}");
        }
        window.set_cursor_visible(!take);
        if take {
            self.overlay.leave(window);
        }
        lock(&self.controls, |controls| controls.take_mouse(take));
    }

    fn toggle_full_screen(&self) {
        let Some(window) = &self.window else { return };
        let full = window.fullscreen().is_none();
        window.set_fullscreen(full.then_some(Fullscreen::Borderless(None)));
    }

    fn close(&self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(window) = &self.window {
            window.set_title("Fathomless: ending");
        }
    }
}

impl<'scope, F, T> ApplicationHandler<News> for Desktop<'scope, '_, F, T>
where
    F: FnOnce(Link) -> T + Send + 'scope,
    T: Send + 'scope,
{
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if let Some(fly) = self.fly.take()
            && let Err(error) = self.open(events, fly)
        {
            self.failed = Some(error);
            events.exit();
        }
    }

    fn user_event(&mut self, events: &ActiveEventLoop, news: News) {
        match news {
            News::Title(title) => {
                if let Some(window) = &self.window {
                    window.set_title(&title);
                }
            }
            News::Ended => events.exit(),
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let due = self.window.as_ref().and_then(|window| self.overlay.tend(window));
        events.set_control_flow(due.map_or(ControlFlow::Wait, ControlFlow::WaitUntil));
    }

    fn window_event(&mut self, _: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if self.is_for_panels(&event) {
            return;
        }
        match event {
            WindowEvent::CloseRequested | WindowEvent::Destroyed => self.close(),
            WindowEvent::Resized(size) => {
                lock(&self.controls, |controls| controls.resize([size.width, size.height]));
            }
            WindowEvent::Occluded(hidden) => lock(&self.controls, |controls| controls.hide(hidden)),
            WindowEvent::Focused(false) => {
                lock(&self.controls, Controls::release_all);
                self.take_mouse(false);
            }
            WindowEvent::KeyboardInput {
                event: KeyEvent { physical_key: PhysicalKey::Code(key), state, repeat: false, .. },
                ..
            } => self.key(key, state),
            WindowEvent::CursorMoved { position, .. } => {
                lock(&self.controls, |controls| controls.point(Some([position.x, position.y])));
            }
            WindowEvent::CursorLeft { .. } => lock(&self.controls, |controls| controls.point(None)),
            WindowEvent::MouseWheel { delta, .. } => {
                let notches = match delta {
                    MouseScrollDelta::LineDelta(_, lines) => lines,
                    MouseScrollDelta::PixelDelta(pixels) => pixels.y as f32 / PIXELS_PER_NOTCH,
                };
                lock(&self.controls, |controls| controls.wheel(notches));
            }
            _ => {}
        }
    }

    fn device_event(&mut self, _: &ActiveEventLoop, _: DeviceId, event: DeviceEvent) {
        if let DeviceEvent::MouseMotion { delta: (x, y) } = event {
            lock(&self.controls, |controls| controls.look([x, y]));
        }
    }
}
