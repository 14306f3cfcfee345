//! EDGE: the desktop window: its events on the main thread, the flight on another, so that neither waits for the other.
//!
//! | file | noun |
//! |---|---|
//! | `controls` | keys, mouse and gamepad, as [`Input`](crate::input::Input) |
//! | `gamepad` | sticks and buttons |
//! | `pane` | which part of which eye's picture is seen where |
//! | `spectator` | a camera that turns after the eye smoothly |
//! | `compose` | the window's picture, drawn |
//! | `mirror` | and shown |
//! | `overlay` | the panels over it |

mod compose;
mod controls;
mod gamepad;
mod mirror;
mod overlay;
mod pane;
mod spectator;

pub use compose::{Composer, MIRROR_SHADER, PanePush, Scene};
pub use controls::{Controls, Hands};
pub use gamepad::{PadState, PadWish, Pads};
pub use mirror::Mirror;
pub use pane::{Pane, SPECTATOR_SHARE, Sights};
pub use spectator::Spectator;

use std::ffi::CStr;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Scope, ScopedJoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use raw_window_handle::HasDisplayHandle;
use winit::application::ApplicationHandler;
use winit::dpi::LogicalSize;
use winit::error::EventLoopError;
use winit::event::{
    DeviceEvent, DeviceId, ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent,
};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::{CursorGrabMode, Fullscreen, Window, WindowId};

use crate::gpu::{Gpu, surface_extension};
use crate::panels::{Painted, Panels};
use crate::settings::{Action, GamepadSettings, MirrorSettings, Settings, Side};
use overlay::{Canvas, Overlay};

/// Where touchpads count pixels, so many are a notch of the wheel.
const PIXELS_PER_NOTCH: f32 = 40.0;

/// Longest wait for the window to go once the flight is over: a display that hangs does not even take that.
const PATIENCE: Duration = Duration::from_secs(5);

/// From one look at the title's words to the next.
pub const TITLE_EVERY: Duration = Duration::from_millis(250);

/// A display that a window can be opened on.
pub struct Display(EventLoop<News>);

/// What the flight tells the window.
enum News {
    /// A gamepad's button does this.
    Do(Action),
    FullScreen(bool),
    /// The flight is over.
    Ended,
}

/// The flight's end of the window.
pub struct Link {
    window: Arc<Window>,
    controls: Arc<Mutex<Controls>>,
    canvas: Arc<Canvas>,
    title: Arc<Mutex<String>>,
    news: EventLoopProxy<News>,
    gamepad: GamepadSettings,
    /// None: nobody listens.
    pads: Option<Pads>,
}

impl Link {
    /// What is wanted in the next frame.
    pub fn hands(&mut self) -> Hands {
        let wish = self.pads.as_ref().map(|pads| PadWish::new(&pads.state(), &self.gamepad));
        lock(&self.controls, |controls| {
            for action in controls.pad(wish.unwrap_or_default()) {
                // Where the window has gone, nothing is left to do.
                let _ = self.news.send_event(News::Do(action));
            }
            controls.take()
        })
    }

    /// The dive of a double-click has arrived.
    pub fn land(&self) {
        lock(&self.controls, Controls::land);
    }

    /// The window shows another picture.
    pub fn show(&self, side: Side) {
        lock(&self.controls, |controls| controls.show(side));
    }

    /// Other settings, instead of `old` ones: what has been changed by hand since stays, unless they differ in it.
    pub fn set(&mut self, settings: &Settings, old: Option<&Settings>) {
        let listens = old.is_some_and(|old| old.gamepad.enabled);
        if settings.gamepad.enabled != listens {
            self.pads = settings.gamepad.enabled.then(Pads::open);
        }
        self.gamepad.clone_from(&settings.gamepad);
        let Some(old) = old else { return };
        let (mirror, was) = (settings.mirror, old.mirror);
        lock(&self.controls, |controls| {
            controls.set(settings);
            if mirror.side != was.side {
                controls.show(mirror.side);
            }
        });
        if mirror.full_screen != was.full_screen {
            let _ = self.news.send_event(News::FullScreen(mirror.full_screen));
        }
    }

    /// The panels are shown.
    pub fn has_panels(&self) -> bool {
        self.canvas.is_shown()
    }

    /// A new picture of the panels, where there is one.
    pub fn painted(&self) -> Option<Painted> {
        self.canvas.take()
    }

    /// Has the title bar's words written, which the window takes up when it next looks ([`TITLE_EVERY`]).
    pub fn set_title(&self, write: impl FnOnce(&mut String) -> fmt::Result) {
        let mut title = self.title.lock().unwrap_or_else(PoisonError::into_inner);
        title.clear();
        // Writing to a string does not fail.
        let _ = write(&mut title);
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
        settings: &Settings,
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
                settings,
                stop,
                news,
                fly: Some(fly),
                flight: None,
                window: None,
                failed: None,
                controls: Arc::new(Mutex::new(Controls::new(settings))),
                overlay: Overlay::new(panels),
                title_bar: TitleBar::new(),
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
    settings: &'env Settings,
    stop: &'env AtomicBool,
    news: EventLoopProxy<News>,
    fly: Option<F>,
    flight: Option<ScopedJoinHandle<'scope, T>>,
    window: Option<Arc<Window>>,
    failed: Option<anyhow::Error>,
    controls: Arc<Mutex<Controls>>,
    overlay: Overlay,
    title_bar: TitleBar,
}

/// Room for a title: writing one takes nothing from the heap.
const TITLE_ROOM: usize = 1024;

/// The words over the window.
struct TitleBar {
    /// What the flight has written.
    title: Arc<Mutex<String>>,
    shown: String,
    /// When it is looked at next.
    due: Option<Instant>,
}

impl TitleBar {
    fn new() -> TitleBar {
        let title = Arc::new(Mutex::new(String::with_capacity(TITLE_ROOM)));
        TitleBar { title, shown: String::new(), due: None }
    }

    /// Shows what has been written, where it is time to; when it will be again.
    fn tend(&mut self, window: &Window) -> Instant {
        let now = Instant::now();
        match self.due.filter(|due| now < *due) {
            Some(due) => due,
            None => {
                let title = self.title.lock().unwrap_or_else(PoisonError::into_inner);
                if !title.is_empty() && *title != self.shown {
                    self.shown.clone_from(&title);
                    drop(title);
                    window.set_title(&self.shown);
                }
                *self.due.insert(now + TITLE_EVERY)
            }
        }
    }
}

impl<'scope, F, T> Desktop<'scope, '_, F, T>
where
    F: FnOnce(Link) -> T + Send + 'scope,
    T: Send + 'scope,
{
    fn open(&mut self, events: &ActiveEventLoop, fly: F) -> Result<()> {
        let MirrorSettings { size, full_screen, .. } = self.settings.mirror;
        let attributes = Window::default_attributes()
            .with_title(self.title)
            .with_inner_size(LogicalSize::new(size.width, size.height))
            .with_fullscreen(full_screen.then_some(Fullscreen::Borderless(None)));
        let window = Arc::new(events.create_window(attributes).context("cannot open a window")?);
        let size = window.inner_size();
        lock(&self.controls, |controls| controls.resize([size.width, size.height]));
        let link = Link {
            window: Arc::clone(&window),
            controls: Arc::clone(&self.controls),
            canvas: self.overlay.canvas(),
            title: Arc::clone(&self.title_bar.title),
            news: self.news.clone(),
            gamepad: self.settings.gamepad.clone(),
            pads: None,
        };
        self.window = Some(window);
        let settings = self.settings;
        self.flight = Some(self.scope.spawn(move || {
            let mut link = link;
            link.set(settings, None);
            fly(link)
        }));
        Ok(())
    }

    fn key(&mut self, key: KeyCode, state: ElementState) {
        if state == ElementState::Released {
            return lock(&self.controls, |controls| controls.release(key));
        }
        for action in lock(&self.controls, |controls| controls.press(key)) {
            self.act(action);
        }
    }

    /// Does what is the window's part of an action.
    fn act(&mut self, action: Action) {
        let taken = lock(&self.controls, |controls| controls.has_mouse());
        match action {
            Action::TakeMouse => self.take_mouse(!taken),
            Action::End if taken => self.take_mouse(false),
            Action::End => self.close(),
            Action::Panels => self.toggle_panels(),
            Action::FullScreen => {
                self.fill_screen(self.window.as_ref().is_some_and(|window| window.fullscreen().is_none()));
            }
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
        self.overlay.remember(event);
        let Some(window) = self.window.as_ref().filter(|_| self.overlay.is_shown()) else { return false };
        // A mouse that looks around does not point, and what shows the panels hides them.
        let is_for_flight = lock(&self.controls, |controls| {
            let hides = match event {
                WindowEvent::KeyboardInput {
                    event: KeyEvent { physical_key: PhysicalKey::Code(key), .. },
                    ..
                } => controls.does(*key, Action::Panels),
                _ => false,
            };
            hides || controls.has_mouse()
        });
        if is_for_flight {
            // Which window has the keyboard, and what is held on it, is everybody's business.
            if matches!(event, WindowEvent::ModifiersChanged(_) | WindowEvent::Focused(_)) {
                self.overlay.takes(window, event);
            }
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

    fn fill_screen(&self, full: bool) {
        if let Some(window) = &self.window {
            window.set_fullscreen(full.then_some(Fullscreen::Borderless(None)));
        }
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
            News::Do(action) => self.act(action),
            News::FullScreen(full) => self.fill_screen(full),
            News::Ended => events.exit(),
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let Some(window) = &self.window else { return };
        let titled = self.title_bar.tend(window);
        let painted = self.overlay.tend(window);
        events.set_control_flow(ControlFlow::WaitUntil(painted.map_or(titled, |due| due.min(titled))));
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
            WindowEvent::MouseInput { state: ElementState::Pressed, button: MouseButton::Left, .. } => {
                lock(&self.controls, |controls| controls.click(Instant::now()));
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
