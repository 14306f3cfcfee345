//! Whatever functions an application calls in whatever order with whatever arguments, every answer is one that the
//! registry gives the function, nothing crashes or hangs, and nothing is left: the next application finds all in order.
//! So too when several threads call at once, and with pictures on a device that the runtime has made.
//!
//! `FATHOMLESS_FUZZ_SEQUENCES=100000` runs so many sequences instead of the few of everyday (with pictures, a twentieth of
//! them) and counts the answers, `FATHOMLESS_FUZZ_SEED=n` runs the n-th alone and tells every call.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "functions called as no application should")]

mod fuzz_support;

use std::{
    cell::Cell,
    collections::{BTreeMap, HashMap},
    env,
    ffi::{CString, c_char, c_void},
    mem,
    ptr::null,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use ash::vk;
use fathomless::mock::{
    Act, Clock, InputAct, Mask, Mock, MockConfig, PerformanceNotice, Pose, Timing, function_names, registry,
};
use fuzz_support::{Arena, Dice, graphics::Vulkan, threads};
use glam::{Quat, Vec3};
use openxr as xr;
use xr::sys::{self, Handle as _, Result as R};

/// Sequences of an everyday run.
const EVERYDAY: u64 = 10_000;
/// Of several threads at once.
const EVERYDAY_TOGETHER: u64 = 2_000;
/// With pictures.
const EVERYDAY_PICTURES: u64 = 300;
/// Runs of one in so many have validation layers listen.
const VALIDATED: u64 = 20;
/// A call that takes longer hangs.
const PATIENCE: Duration = Duration::from_secs(60);
/// Room that is enough for every list and text of the runtime.
const ENOUGH: usize = 512;

/// Arguments that are integers and pointers fit into these registers and stack places.
type Any = unsafe extern "system" fn(u64, u64, u64, u64, u64, u64, u64, u64) -> R;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Instance,
    Session,
    Swapchain,
    Space,
    ActionSet,
    Action,
    HandTracker,
    Messenger,
}

use Kind::*;

const KINDS: [Kind; 8] = [Instance, Session, Swapchain, Space, ActionSet, Action, HandTracker, Messenger];

impl Kind {
    fn destroyer(self) -> &'static str {
        match self {
            Instance => "xrDestroyInstance",
            Session => "xrDestroySession",
            Swapchain => "xrDestroySwapchain",
            Space => "xrDestroySpace",
            ActionSet => "xrDestroyActionSet",
            Action => "xrDestroyAction",
            HandTracker => "xrDestroyHandTrackerEXT",
            Messenger => "xrDestroyDebugUtilsMessengerEXT",
        }
    }
}

/// What carries a life forward, so that sequences get deep.
const PROGRESS: [&str; 22] = [
    "xrPollEvent",
    "xrPollEvent",
    "xrPollEvent",
    "xrBeginSession",
    "xrBeginSession",
    "xrWaitFrame",
    "xrWaitFrame",
    "xrBeginFrame",
    "xrBeginFrame",
    "xrEndFrame",
    "xrEndFrame",
    "xrSyncActions",
    "xrSyncActions",
    "xrCreateReferenceSpace",
    "xrCreateActionSet",
    "xrCreateAction",
    "xrCreateAction",
    "xrSuggestInteractionProfileBindings",
    "xrAttachSessionActionSets",
    "xrCreateSwapchain",
    "xrAcquireSwapchainImage",
    "xrWaitSwapchainImage",
];

fn config() -> MockConfig {
    MockConfig { clock: Clock::Stepped { hz: 100.0 }, eye_size: [16, 16], ..MockConfig::default() }
}

thread_local! {
    /// What a messenger's callback calls.
    static BACK: Cell<Option<Any>> = const { Cell::new(None) };
}

/// A debug messenger that calls the runtime while it listens.
unsafe extern "system" fn listen(
    _: sys::DebugUtilsMessageSeverityFlagsEXT,
    _: sys::DebugUtilsMessageTypeFlagsEXT,
    data: *const sys::DebugUtilsMessengerCallbackDataEXT,
    _: *mut c_void,
) -> sys::Bool32 {
    // SAFETY: the runtime gives a valid message.
    let text = unsafe { std::ffi::CStr::from_ptr((*data).message) };
    assert!(text.to_str().is_ok());
    if let Some(enumerate_layers) = BACK.get() {
        let mut count = 0u32;
        // SAFETY: xrEnumerateApiLayerProperties with a capacity of 0 and room for the count.
        unsafe { enumerate_layers(0, (&raw mut count) as u64, 0, 0, 0, 0, 0, 0) };
    }
    sys::FALSE
}

/// A Vulkan loader that knows one function, which fails.
unsafe extern "system" fn barren_loader(
    _: sys::platform::VkInstance,
    _: *const c_char,
) -> Option<unsafe extern "system" fn()> {
    unsafe extern "system" fn out_of_memory(_: *const c_void, _: *const c_void, _: *mut c_void) -> i32 {
        vk::Result::ERROR_OUT_OF_HOST_MEMORY.as_raw()
    }
    type Create = unsafe extern "system" fn(*const c_void, *const c_void, *mut c_void) -> i32;
    // SAFETY: the caller asks for vkCreateInstance and casts the pointer back to that.
    Some(unsafe { mem::transmute::<Create, unsafe extern "system" fn()>(out_of_memory) })
}

/// What carries pictures to the display.
const PICTURES: [&str; 15] = [
    "xrPollEvent",
    "xrWaitFrame",
    "xrBeginFrame",
    "xrEndFrame",
    "xrEndFrame",
    "xrCreateSwapchain",
    "xrEnumerateSwapchainImages",
    "xrAcquireSwapchainImage",
    "xrAcquireSwapchainImage",
    "xrWaitSwapchainImage",
    "xrWaitSwapchainImage",
    "xrReleaseSwapchainImage",
    "xrReleaseSwapchainImage",
    "xrDestroySwapchain",
    "xrCreateReferenceSpace",
];

/// Everything that was seen of all sequences.
#[derive(Default)]
struct Seen {
    sequences: u64,
    calls: u64,
    /// How often each function returned each code.
    answers: BTreeMap<(&'static str, i32), u64>,
    functions: HashMap<usize, HashMap<&'static str, Any>>,
    /// What went wrong, and the first sequence and call that showed it.
    faults: BTreeMap<String, String>,
}

impl Seen {
    fn add(&mut self, other: Self) {
        self.sequences += other.sequences;
        self.calls += other.calls;
        for (answer, times) in other.answers {
            *self.answers.entry(answer).or_default() += times;
        }
        for (fault, call) in other.faults {
            self.faults.entry(fault).or_insert(call);
        }
    }

    fn times(&self, name: &'static str, code: R) -> u64 {
        self.answers.get(&(name, code.into_raw())).copied().unwrap_or(0)
    }

    fn tell(&self, what: &str, started: Instant) {
        println!(
            "{} sequences {what}, {} calls, {:.1} s, {} different answers",
            self.sequences,
            self.calls,
            started.elapsed().as_secs_f64(),
            self.answers.len(),
        );
        if env::var_os("FATHOMLESS_FUZZ_SEQUENCES").is_some() {
            for ((name, code), times) in &self.answers {
                println!("{name} {:?}: {times}", R::from_raw(*code));
            }
        }
        for (fault, call) in &self.faults {
            println!("{fault}: {call}");
        }
        assert!(self.faults.is_empty(), "{} different faults, told above", self.faults.len());
    }
}

#[derive(Clone)]
struct Handle {
    kind: Kind,
    raw: u64,
    parent: u64,
}

/// One sequence, or one thread's part of it.
struct Run<'a> {
    seen: &'a mut Seen,
    vulkan: Arc<Vulkan>,
    mock: Mock,
    functions: HashMap<&'static str, Any>,
    offered: Vec<String>,
    dice: Dice,
    arena: Arena,
    seed: u64,
    tell: bool,
    graphics: bool,
    /// Functions that it prefers to others.
    progress: &'static [&'static str],
    /// It may wait for frames: of several threads only one, since a wait that nobody's frame follows does not end.
    waits: bool,
    /// Other threads call too: it lets them.
    shares: bool,
    /// One argument in so many is nonsense; 0: none.
    nonsense: usize,
    living: Vec<Handle>,
    dead: Vec<(Kind, u64)>,
    foreign: u64,
    paths: HashMap<(u64, String), u64>,
    system: u64,
    time: i64,
    /// Sessions with a frame waited for and not begun: to wait again would block.
    waited: Vec<u64>,
    names: u32,
    /// What the call under construction must come to.
    bad_subject: bool,
    doomed: bool,
    created: Option<(Kind, *mut u64)>,
}

/// The progress of the run, for the watchdog: the sequence, and calls so far.
static SEQUENCE: AtomicU64 = AtomicU64::new(0);
static CALLS: AtomicU64 = AtomicU64::new(0);

const USER_PATHS: [&str; 4] = ["/user/hand/left", "/user/hand/right", "/user/head", "/user/gamepad"];

const ODD_FLOATS: [f32; 8] =
    [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0, f32::MAX, f32::MIN, 1e-42, -1.0];

impl<'a> Run<'a> {
    fn new(seen: &'a mut Seen, vulkan: Arc<Vulkan>, foreign: u64, seed: u64, tell: bool) -> Self {
        let mut dice = Dice::new(seed);
        let mock = Mock::new(MockConfig {
            read_back: dice.once_in(4),
            shuffle_images: dice.once_in(4),
            image_timeouts: u32::from(dice.once_in(4)),
            unavailable_calls: u32::from(dice.once_in(16)),
            fov_mutable: !dice.once_in(4),
            ..config()
        });
        let get = mock.get_instance_proc_addr().unwrap();
        let functions = seen.functions.entry(get as usize).or_insert_with(|| functions(&mock)).clone();
        let offered = mock.entry().unwrap().enumerate_extensions().unwrap();
        let offered: Vec<String> = offered
            .names()
            .iter()
            .map(|name| String::from_utf8_lossy(name).trim_end_matches('\0').to_owned())
            .collect();
        BACK.set(functions.get("xrEnumerateApiLayerProperties").copied());
        Self {
            offered,
            graphics: seed.is_multiple_of(8),
            progress: &PROGRESS,
            waits: true,
            shares: false,
            seen,
            vulkan,
            mock,
            functions,
            dice,
            arena: Arena::default(),
            seed,
            tell,
            nonsense: 0,
            living: Vec::new(),
            dead: Vec::new(),
            foreign,
            paths: HashMap::new(),
            system: 0,
            time: 1_000_000_000,
            waited: Vec::new(),
            names: 0,
            bad_subject: false,
            doomed: false,
            created: None,
        }
    }

    // --- arguments -------------------------------------------------------------------------------------------------

    /// Whether the next argument is to be nonsense.
    fn odd(&mut self) -> bool {
        self.nonsense > 0 && self.dice.once_in(self.nonsense)
    }

    fn number(&mut self, good: &[i32]) -> i32 {
        if self.odd() {
            let any = self.dice.word() as i32;
            return self.dice.pick(&[0, -1, 1, 2, 3, i32::MAX, i32::MIN, any]);
        }
        self.dice.pick(good)
    }

    fn count(&mut self, good: &[u32]) -> u32 {
        if self.odd() {
            let any = self.dice.word() as u32;
            return self.dice.pick(&[0, 1, 2, u32::MAX, u32::MAX / 2, 1 << 16, any]);
        }
        self.dice.pick(good)
    }

    fn bits(&mut self, good: &[u64]) -> u64 {
        if self.odd() {
            let any = self.dice.word();
            return self.dice.pick(&[0, u64::MAX, 1 << 63, any]);
        }
        self.dice.pick(good)
    }

    fn float(&mut self, good: &[f32]) -> f32 {
        if self.odd() {
            let any = f32::from_bits(self.dice.word() as u32);
            return if self.dice.once_in(3) { any } else { self.dice.pick(&ODD_FLOATS) };
        }
        self.dice.pick(good)
    }

    fn time(&mut self) -> i64 {
        if self.odd() {
            let any = self.dice.word() as i64;
            return self.dice.pick(&[0, -1, 1, i64::MIN, i64::MAX, any]);
        }
        self.time
    }

    fn boolean(&mut self) -> u32 {
        if self.odd() { self.dice.pick(&[2, u32::MAX]) } else { self.dice.pick(&[0, 1]) }
    }

    fn vector(&mut self) -> sys::Vector3f {
        let [x, y, z] = [0; 3].map(|_| self.float(&[0.0, 0.5, -1.0, 2.0]));
        sys::Vector3f { x, y, z }
    }

    fn turn(&mut self) -> sys::Quaternionf {
        if self.odd() {
            let [x, y, z, w] = [0; 4].map(|_| self.float(&[0.0, 1.0]));
            return sys::Quaternionf { x, y, z, w };
        }
        self.dice.pick(&[
            sys::Quaternionf { x: 0.0, y: 0.0, z: 0.0, w: 1.0 },
            sys::Quaternionf { x: 0.0, y: 0.6, z: 0.0, w: 0.8 },
        ])
    }

    fn pose(&mut self) -> sys::Posef {
        sys::Posef { orientation: self.turn(), position: self.vector() }
    }

    /// A handle of a kind; and whether it is surely none.
    fn any_handle(&mut self, kind: Kind) -> (u64, bool) {
        let of_kind: Vec<u64> = self.living.iter().filter(|it| it.kind == kind).map(|it| it.raw).collect();
        if let Some(&last) = of_kind.last()
            && !self.odd()
        {
            return (if self.dice.once_in(4) { self.dice.pick(&of_kind) } else { last }, false);
        }
        let other: Vec<u64> = self.living.iter().filter(|it| it.kind != kind).map(|it| it.raw).collect();
        let raw = match self.dice.below(6) {
            0 => 0,
            1 if !self.dead.is_empty() => self.dead[self.dice.below(self.dead.len())].1,
            2 => self.foreign,
            3 if !other.is_empty() => self.dice.pick(&other),
            4 if !of_kind.is_empty() => self.dice.pick(&of_kind) ^ (1 << self.dice.below(64)),
            _ => self.dice.word(),
        };
        (raw, true)
    }

    fn handle(&mut self, kind: Kind) -> u64 {
        self.any_handle(kind).0
    }

    /// The handle that a function belongs to, its first argument.
    fn subject(&mut self, kind: Kind) -> u64 {
        let (raw, bad) = self.any_handle(kind);
        self.bad_subject = bad;
        raw
    }

    fn system(&mut self) -> u64 {
        if self.odd() {
            let any = self.dice.word();
            return self.dice.pick(&[0, u64::MAX, 2, any]);
        }
        self.system
    }

    /// The path of a text in the newest instance.
    fn path_of(&mut self, text: &str) -> u64 {
        if self.odd() {
            let any = self.dice.word();
            return self.dice.pick(&[0, 1, 7, 40, u64::MAX, any]);
        }
        let instance = self.living.iter().rfind(|it| it.kind == Instance).map_or(0, |it| it.raw);
        if let Some(path) = self.paths.get(&(instance, text.to_owned())) {
            return *path;
        }
        let mut path = 0u64;
        let place = (&raw mut path) as u64;
        let text_place = self.arena.text(text.as_bytes()) as u64;
        let code = self.call("xrStringToPath", &[instance, text_place, place]);
        if code == R::SUCCESS {
            self.paths.insert((instance, text.to_owned()), path);
        }
        path
    }

    fn user_path(&mut self) -> u64 {
        let text = self.dice.pick(&USER_PATHS);
        let none = self.dice.once_in(3);
        if none { 0 } else { self.path_of(text) }
    }

    /// A profile, mostly that of the simple controller; it and the text of one of its components.
    fn component(&mut self) -> (&'static registry::Profile, String) {
        let simple = registry::profile("/interaction_profiles/khr/simple_controller").unwrap();
        let any = self.dice.once_in(4);
        let profile =
            if any { &registry::PROFILES[self.dice.below(registry::PROFILES.len())] } else { simple };
        let component = &profile.components[self.dice.below(profile.components.len())];
        let user_path = component.user_path.unwrap_or_else(|| self.dice.pick(profile.user_paths));
        (profile, format!("{user_path}{}", component.subpath))
    }

    fn source_path(&mut self) -> u64 {
        let (_, text) = self.component();
        self.path_of(&text)
    }

    // --- memory ----------------------------------------------------------------------------------------------------

    fn put<T: Copy>(&mut self, value: T) -> *mut T {
        self.arena.put(value)
    }

    /// A pointer to something without a type that must be there.
    fn place<T: Copy>(&mut self, value: T) -> u64 {
        if self.odd() {
            self.doomed = true;
            let off = self.arena.bytes(size_of::<T>() + 1) as u64 + 1;
            return if align_of::<T>() > 1 && self.dice.once_in(2) { off } else { 0 };
        }
        self.put(value) as u64
    }

    fn new_handle(&mut self, kind: Kind) -> u64 {
        let place = self.place(0u64);
        if !self.doomed {
            self.created = Some((kind, place as *mut u64));
        }
        place
    }

    /// A chain of structures that nobody knows; whether it is one that no function may accept.
    fn chain(&mut self) -> (*const c_void, bool) {
        let stranger = |next| sys::BaseInStructure { ty: sys::StructureType::from_raw(0x7FFF_0000), next };
        let mut head: *const sys::BaseInStructure = null();
        match self.dice.below(5) {
            0 => {
                // Bites its tail.
                let first = self.put(stranger(null()));
                let second = self.put(stranger(first.cast_const()));
                // SAFETY: the arena's own memory, nobody else's yet.
                unsafe { (*first).next = second };
                (first.cast_const().cast(), true)
            }
            1 => {
                for _ in 0..300 {
                    head = self.put(stranger(head));
                }
                (head.cast(), true)
            }
            2 => {
                let place = self.arena.bytes(size_of::<sys::BaseInStructure>() + 8);
                // SAFETY: within the piece.
                (unsafe { place.add(4) }.cast_const().cast(), true)
            }
            _ => {
                for _ in 0..self.dice.below(200) {
                    head = self.put(stranger(head));
                }
                (head.cast(), false)
            }
        }
    }

    /// A structure that begins with type and next, sometimes spoilt.
    fn typed<T: Copy>(&mut self, value: T, optional: bool) -> u64 {
        if optional && self.dice.once_in(2) {
            return 0;
        }
        if !self.odd() {
            return self.put(value) as u64;
        }
        let place = self.put(value);
        let base = place.cast::<sys::BaseInStructure>();
        match self.dice.below(5) {
            0 => {
                self.doomed |= !optional;
                0
            }
            1 => {
                self.doomed = true;
                self.arena.bytes(size_of::<T>() + 8) as u64 + 4
            }
            2 => {
                self.doomed = true;
                let any = self.dice.word() as i32 | 1 << 30;
                let ty = self.dice.pick(&[0, -1, any]);
                // SAFETY: T begins with type and next.
                unsafe { (*base).ty = sys::StructureType::from_raw(ty) };
                place as u64
            }
            _ => {
                let (next, endless) = self.chain();
                self.doomed |= endless;
                // SAFETY: T begins with type and next; an endless chain may take the place of a good one, another not.
                unsafe {
                    if endless || (*base).next.is_null() {
                        (*base).next = next.cast();
                    }
                }
                place as u64
            }
        }
    }

    fn input<T: Copy>(&mut self, value: T) -> u64 {
        self.typed(value, false)
    }

    fn output<T: Copy>(&mut self, ty: sys::StructureType) -> u64 {
        // SAFETY: the API's structures are all valid as zeros.
        let mut value: T = unsafe { mem::zeroed() };
        // SAFETY: T begins with type and next.
        unsafe { (*(&raw mut value).cast::<sys::BaseOutStructure>()).ty = ty };
        self.typed(value, false)
    }

    /// Capacity, count and room of a list. The room is what the capacity says, or enough.
    fn list<T: Copy>(&mut self, item: T) -> [u64; 3] {
        let capacity = if self.odd() {
            self.dice.pick(&[1, 2, 3, 7, 26, u32::MAX])
        } else {
            self.dice.pick(&[0, ENOUGH as u32])
        };
        let count = self.place(0u32);
        let room = (capacity as usize).min(ENOUGH);
        let items = self.arena.array(&vec![item; room]);
        let items = if self.odd() || room == 0 { 0 } else { items as u64 };
        [u64::from(capacity), count, items]
    }

    fn typed_list<T: Copy>(&mut self, ty: sys::StructureType) -> [u64; 3] {
        // SAFETY: the API's structures are all valid as zeros.
        let mut item: T = unsafe { mem::zeroed() };
        let ty = if self.odd() { sys::StructureType::UNKNOWN } else { ty };
        // SAFETY: T begins with type and next.
        unsafe { (*(&raw mut item).cast::<sys::BaseOutStructure>()).ty = ty };
        self.list(item)
    }

    fn text(&mut self, good: &str) -> *const c_char {
        if !self.odd() {
            return self.arena.text(good.as_bytes());
        }
        match self.dice.below(6) {
            0 => {
                self.doomed = true;
                null()
            }
            1 => {
                self.doomed = true;
                self.arena.text(b"\xFF\xC0 not UTF-8")
            }
            2 => self.arena.text(b""),
            3 => self.arena.text(&[b'/'; 300]),
            4 => self.arena.text(format!("/user/{}", "a".repeat(5_000)).as_bytes()),
            _ => self.arena.text("/user/Ünicode/../hand".as_bytes()),
        }
    }

    /// A text that may be left out.
    fn optional_text(&mut self, good: &str) -> *const c_char {
        if self.dice.once_in(3) {
            return null();
        }
        let doomed = self.doomed;
        let text = self.text(good);
        self.doomed = doomed;
        text
    }

    /// A name in place, each time another.
    fn name<const N: usize>(&mut self) -> [c_char; N] {
        self.names += 1;
        let good = format!("name-{}", self.names);
        let text = if self.odd() {
            match self.dice.below(6) {
                0 => Vec::new(),
                1 => vec![b'a'; N],
                2 => b"With Spaces".to_vec(),
                3 => b"\xFF\xFE".to_vec(),
                4 => b"name-1".to_vec(),
                _ => (0..N).map(|_| self.dice.word() as u8).collect(),
            }
        } else {
            good.into_bytes()
        };
        let mut chars = [0; N];
        for (to, from) in chars.iter_mut().zip(text) {
            *to = from as c_char;
        }
        chars
    }
}

// --- calls ---------------------------------------------------------------------------------------------------------

/// All functions of a mock, as an instance with every extension finds them.
fn functions(mock: &Mock) -> HashMap<&'static str, Any> {
    let entry = mock.entry().unwrap();
    let offered = entry.enumerate_extensions().unwrap();
    let info = xr::ApplicationInfo {
        application_name: "finder",
        api_version: xr::Version::new(1, 1, 0),
        ..Default::default()
    };
    let instance = entry.create_instance(&info, &offered, &[], &()).unwrap();
    let get = mock.get_instance_proc_addr().unwrap();
    let find = |name: &'static str| {
        let text = CString::new(name).unwrap();
        let mut function = None;
        // SAFETY: a living instance, a text, room for a pointer.
        let code = unsafe { get(instance.as_raw(), text.as_ptr(), &mut function) };
        assert_eq!(code, R::SUCCESS, "{name}");
        // SAFETY: C functions take more arguments than they have names for.
        (name, unsafe { mem::transmute::<sys::pfn::VoidFunction, Any>(function.unwrap()) })
    };
    function_names().map(find).collect()
}

impl Run<'_> {
    fn call(&mut self, name: &'static str, arguments: &[u64]) -> R {
        let mut all = [0; 8];
        all[..arguments.len()].copy_from_slice(arguments);
        let [a, b, c, d, e, f, g, h] = all;
        let function = self.functions[name];
        let session = sys::Session::from_raw(a);
        let (first, second) = (sys::Path::from_raw(b), sys::Path::from_raw(c));
        CALLS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the arguments keep the promises about memory that the runtime cannot verify; the rest it does.
        let code = unsafe {
            match name {
                "xrRequestDisplayRefreshRateFB" => {
                    let function: sys::pfn::RequestDisplayRefreshRateFB = mem::transmute(function);
                    function(session, self.float(&[90.0, 72.0, 100.0]))
                }
                "xrSetInputDeviceStateFloatEXT" => {
                    let function: sys::pfn::SetInputDeviceStateFloatEXT = mem::transmute(function);
                    function(session, first, second, self.float(&[0.0, 1.0]))
                }
                "xrSetInputDeviceStateVector2fEXT" => {
                    let function: sys::pfn::SetInputDeviceStateVector2fEXT = mem::transmute(function);
                    let [x, y] = [0; 2].map(|_| self.float(&[0.0, 1.0, -1.0]));
                    function(session, first, second, sys::Vector2f { x, y })
                }
                "xrSetInputDeviceLocationEXT" => {
                    let function: sys::pfn::SetInputDeviceLocationEXT = mem::transmute(function);
                    function(session, first, second, sys::Space::from_raw(d), self.pose())
                }
                _ => function(a, b, c, d, e, f, g, h),
            }
        };
        if self.tell {
            eprintln!("{name} {arguments:x?} = {code:?}");
        }
        self.seen.calls += 1;
        *self.seen.answers.entry((name, code.into_raw())).or_default() += 1;
        let command = registry::command(name).unwrap();
        let number = code.into_raw();
        let documented = command.successes.contains(&number) || command.errors.contains(&number);
        self.check(documented, name, arguments, &format!("must not answer {code:?}"));
        // Every function may answer so, but this runtime does only where it has a bug, or Vulkan fails.
        self.check(code != R::ERROR_RUNTIME_FAILURE, name, arguments, "failed");
        code
    }

    fn replay(&self) -> String {
        format!("\nreplay with FATHOMLESS_FUZZ_SEED={}", self.seed)
    }

    /// Notes a fault unless the condition holds. The run goes on, so that one does not hide another.
    fn check(&mut self, condition: bool, name: &str, arguments: &[u64], text: &str) {
        if !condition {
            let last = self.mock.violations().last().map(|it| it.text.clone()).unwrap_or_default();
            let call = format!("{arguments:x?} ({last}){}", self.replay());
            self.seen.faults.entry(format!("{name} {text}")).or_insert(call);
        }
    }

    /// One call of a function, and what follows from its answer.
    fn step(&mut self, name: &'static str) -> R {
        self.arena = Arena::default();
        let arguments = self.arguments_anew(name);
        if name == "xrWaitFrame" && (!self.waits || self.waited.contains(&arguments[0])) {
            return R::ERROR_CALL_ORDER_INVALID;
        }
        let (bad_subject, doomed) = (self.bad_subject, self.doomed);
        let code = self.call(name, &arguments);
        let refused = !bad_subject || code == R::ERROR_HANDLE_INVALID;
        self.check(refused, name, &arguments, &format!("answers {code:?} to a handle that is none"));
        let failed = !doomed || code.into_raw() < 0;
        self.check(failed, name, &arguments, &format!("answers {code:?} to what no function may accept"));
        if code.into_raw() >= 0 {
            self.learn(name, &arguments);
        }
        if name == "xrBeginFrame" && code == R::ERROR_CALL_ORDER_INVALID {
            // Another thread has begun the frame that was waited for.
            self.waited.retain(|session| *session != arguments[0]);
        }
        code
    }

    fn arguments_anew(&mut self, name: &str) -> Vec<u64> {
        (self.bad_subject, self.doomed, self.created) = (false, false, None);
        self.arguments(name)
    }

    /// What a success means for the calls to come.
    fn learn(&mut self, name: &'static str, arguments: &[u64]) {
        let subject = arguments[0];
        if let Some((kind, place)) = self.created {
            // SAFETY: the arena's memory, which the call has written.
            let raw = unsafe { *place };
            let known = self.living.iter().any(|it| it.raw == raw) || self.dead.contains(&(kind, raw));
            assert!(raw != 0 && !known, "{name} gave {raw:#x} again{}", self.replay());
            let parent = if kind == Instance { 0 } else { subject };
            self.living.push(Handle { kind, raw, parent });
        }
        if KINDS.iter().any(|kind| kind.destroyer() == name) {
            self.bury(subject);
        }
        match name {
            // SAFETY: the call has written what its last argument points at.
            "xrGetSystem" => self.system = unsafe { *(arguments[2] as *const u64) },
            "xrWaitFrame" => {
                // SAFETY: as above.
                let state = unsafe { *(arguments[2] as *const sys::FrameState) };
                self.time = state.predicted_display_time.as_nanos();
                self.waited.push(subject);
            }
            "xrBeginFrame" | "xrBeginSession" => self.waited.retain(|session| *session != subject),
            _ => {}
        }
    }

    /// A handle and all that depends on it are no more.
    fn bury(&mut self, raw: u64) {
        let Some(index) = self.living.iter().position(|it| it.raw == raw) else { return };
        let handle = self.living.remove(index);
        self.dead.push((handle.kind, raw));
        let children: Vec<u64> = self.living.iter().filter(|it| it.parent == raw).map(|it| it.raw).collect();
        children.into_iter().for_each(|child| self.bury(child));
    }

    /// Something happens to headset or runtime.
    fn happen(&mut self) {
        let level = sys::PerfSettingsNotificationLevelEXT::NORMAL;
        let narrow = fathomless::mock::Fov { left: -0.5, right: 0.5, up: 0.4, down: -0.4 };
        let x = self.dice.below(100) as f32 / 50.0;
        let user_path = self.dice.pick(&USER_PATHS[..2]).to_owned();
        let act = match self.dice.below(30) {
            0..6 => Act::GainFocus,
            6 => Act::LoseFocus,
            7 => Act::Hide,
            8 => Act::Stop,
            9 => Act::Exit,
            10 => Act::LoseSession,
            11 if self.dice.once_in(3) => Act::KillSession,
            12 if self.dice.once_in(3) => {
                Act::LoseInstance(Duration::from_millis(self.dice.below(40) as u64))
            }
            13 => Act::DisconnectFor(1),
            14 => Act::Recentre {
                new_in_previous: Pose::new(Vec3::new(x, 0.0, -x), Quat::from_rotation_y(x)),
                delay: Duration::from_millis(self.dice.below(40) as u64),
            },
            15 => Act::RecentreOnHead,
            16 => Act::Bounds(None),
            17 => Act::Fov([narrow; 2]),
            18 => Act::Mask(Mask::Empty),
            19 => Act::UserPresent(self.dice.once_in(2)),
            20 => Act::Timing(Some(Timing::Jitter { most_ns: 3_000_000 })),
            21 => Act::ImageTimeouts(1),
            22 => Act::Performance(PerformanceNotice {
                domain: sys::PerfSettingsDomainEXT::CPU,
                sub_domain: sys::PerfSettingsSubDomainEXT::RENDERING,
                from: level,
                to: sys::PerfSettingsNotificationLevelEXT::WARNING,
            }),
            23 => Act::ClaimLostEvents(2),
            24 => Act::Formats(vec![vk::Format::R8G8B8A8_SRGB]),
            25 => Act::UnknownEvent,
            26 => Act::Input(InputAct::Hand { user_path, seen: true }),
            27 => Act::Input(InputAct::Disconnect { user_path }),
            _ => Act::Input(InputAct::Connect {
                user_path,
                profile: "/interaction_profiles/khr/simple_controller".to_owned(),
            }),
        };
        if self.tell {
            eprintln!("{act:?}");
        }
        self.mock.perform(act);
    }

    fn play(&mut self, names: &[&'static str]) {
        // Most applications begin well.
        if !self.dice.once_in(12) {
            self.begin_well();
        }
        let most = 20 + self.dice.below(120);
        self.go_on(names, most);
    }

    fn begin_well(&mut self) {
        for name in
            ["xrCreateInstance", "xrGetSystem", "xrGetVulkanGraphicsRequirementsKHR", "xrCreateSession"]
        {
            self.step(name);
        }
        for _ in 0..self.dice.below(5) {
            self.step("xrPollEvent");
        }
        if self.dice.once_in(2) {
            for name in ["xrBeginSession", "xrCreateReferenceSpace", "xrCreateActionSet", "xrCreateAction"] {
                self.step(name);
            }
        }
    }

    fn go_on(&mut self, names: &[&'static str], most: usize) {
        for _ in 0..most {
            self.nonsense = self.dice.pick(&[0, 0, 0, 40, 12, 4]);
            let name =
                if self.dice.once_in(3) { self.dice.pick(self.progress) } else { self.dice.pick(names) };
            let ends = matches!(name, "xrDestroyInstance" | "xrDestroySession" | "xrRequestExitSession");
            if ends && !self.dice.once_in(3) {
                continue;
            }
            self.step(name);
            if self.dice.once_in(20) {
                self.happen();
            }
            if self.shares {
                thread::yield_now();
            }
        }
    }

    /// All instances end, and nothing that was ever made is known any more.
    fn end(&mut self) {
        self.nonsense = 0;
        while let Some(instance) = self.living.iter().find(|it| it.kind == Instance).map(|it| it.raw) {
            let code = self.call("xrDestroyInstance", &[instance]);
            assert_eq!(code, R::SUCCESS, "{}", self.replay());
            self.bury(instance);
        }
        assert!(self.living.is_empty(), "{}", self.replay());
        assert_eq!(self.mock.session_state(), None, "{}", self.replay());
        for (kind, raw) in mem::take(&mut self.dead) {
            let code = self.call(kind.destroyer(), &[raw]);
            let gone = code == R::ERROR_HANDLE_INVALID;
            self.check(gone, kind.destroyer(), &[raw], &format!("answers {code:?} after the end"));
        }
    }

    /// The next application keeps the rules, and has no trouble.
    fn next_application(&mut self) {
        self.mock.perform(Act::GainFocus);
        self.mock.perform(Act::DisconnectFor(0));
        self.mock.perform(Act::Timing(None));
        self.graphics = false;
        let life = [
            "xrCreateInstance",
            "xrGetSystem",
            "xrCreateSession",
            "xrPollEvent",
            "xrPollEvent",
            "xrBeginSession",
            "xrCreateReferenceSpace",
            "xrWaitFrame",
            "xrBeginFrame",
        ];
        let offered = self.offered.clone();
        // Twice, so that one may be left out.
        self.offered =
            ["XR_MND_headless", "XR_EXT_local_floor"].repeat(2).into_iter().map(str::to_owned).collect();
        for name in life {
            let code = self.step(name);
            assert_eq!(code, R::SUCCESS, "{name} of the next application{}", self.replay());
        }
        self.offered = offered;
        let [session, instance] =
            [Session, Instance].map(|kind| self.living.iter().find(|it| it.kind == kind).unwrap().raw);
        let end = self.put(sys::FrameEndInfo {
            ty: sys::FrameEndInfo::TYPE,
            next: null(),
            display_time: sys::Time::from_nanos(self.time),
            environment_blend_mode: sys::EnvironmentBlendMode::OPAQUE,
            layer_count: 0,
            layers: null(),
        }) as u64;
        for (name, arguments) in [
            ("xrEndFrame", &[session, end][..]),
            ("xrDestroySession", &[session]),
            ("xrDestroyInstance", &[instance]),
        ] {
            let code = self.call(name, arguments);
            assert_eq!(code, R::SUCCESS, "{name} of the next application{}", self.replay());
        }
        assert_eq!(self.mock.session_state(), None, "{}", self.replay());
    }
}

/// Ends the process when a call does not come back: there is no other way to tell which.
fn watch() {
    let (mut last, mut since) = (0, Instant::now());
    loop {
        thread::sleep(Duration::from_secs(1));
        let calls = CALLS.load(Ordering::Relaxed);
        if calls != last {
            (last, since) = (calls, Instant::now());
        } else if since.elapsed() > PATIENCE {
            let seed = SEQUENCE.load(Ordering::Relaxed);
            eprintln!("a call hangs: replay with FATHOMLESS_FUZZ_SEED={seed}");
            std::process::abort();
        }
    }
}

fn number_from_env(name: &str) -> Option<u64> {
    env::var(name).ok().map(|text| text.parse().unwrap_or_else(|_| panic!("{name}={text} is no number")))
}

/// Those need a Vulkan instance that the runtime has made: `mock_life` and its neighbours have one.
const WITHOUT_SUCCESS: [&str; 2] = ["xrGetVulkanGraphicsDevice2KHR", "xrCreateVulkanDeviceKHR"];

/// One test at a time: the watchdog tells one sequence's number.
fn alone() -> MutexGuard<'static, ()> {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let guard = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    static WATCHED: std::sync::Once = std::sync::Once::new();
    // It ends with the process.
    WATCHED.call_once(|| drop(thread::spawn(watch)));
    guard
}

/// The numbers of the sequences to run, and whether it is one alone.
fn seeds(everyday: u64, share: u64) -> (std::ops::Range<u64>, bool) {
    let asked = number_from_env("FATHOMLESS_FUZZ_SEQUENCES").map(|sequences| sequences.div_ceil(share));
    match number_from_env("FATHOMLESS_FUZZ_SEED") {
        Some(seed) => (seed..seed + 1, true),
        None => (0..asked.unwrap_or(everyday), false),
    }
}

/// An instance of another runtime, whose handle means nothing here.
fn stranger() -> (Mock, xr::Instance) {
    let stranger = Mock::new(config());
    let info = xr::ApplicationInfo { application_name: "other", ..Default::default() };
    let instance =
        stranger.entry().unwrap().create_instance(&info, &xr::ExtensionSet::default(), &[], &()).unwrap();
    (stranger, instance)
}

#[test]
fn any_calls_in_any_order() {
    let _alone = alone();
    let (seeds, alone) = seeds(EVERYDAY, 1);
    let vulkan = Arc::new(Vulkan::new());
    let (stranger, other) = stranger();
    let names: Vec<_> = function_names().collect();
    let mut seen = Seen::default();
    let started = Instant::now();
    for seed in seeds {
        SEQUENCE.store(seed, Ordering::Relaxed);
        let mut run = Run::new(&mut seen, Arc::clone(&vulkan), other.as_raw().into_raw(), seed, alone);
        run.play(&names);
        run.end();
        run.next_application();
        run.seen.sequences += 1;
    }
    seen.tell("of one thread", started);
    assert_eq!(stranger.violations(), [], "the other runtime knows nothing of it");
    if alone {
        return;
    }
    for name in names {
        let answers = seen.answers.range((name, i32::MIN)..=(name, i32::MAX));
        let (good, bad): (Vec<_>, Vec<_>) = answers.partition(|((_, code), _)| *code >= 0);
        assert!(!bad.is_empty(), "{name} never failed");
        assert!(!good.is_empty() || WITHOUT_SUCCESS.contains(&name), "{name} never succeeded: {bad:?}");
    }
}

/// Three threads share an instance and whatever was made from it: each destroys what another uses.
#[test]
fn several_threads_at_once() {
    let _alone = alone();
    let (seeds, alone) = seeds(EVERYDAY_TOGETHER, 1);
    let vulkan = Arc::new(Vulkan::new());
    let (stranger, other) = stranger();
    let mut seen = Seen::default();
    let started = Instant::now();
    let mut overlapped = 0;
    for seed in seeds.clone() {
        SEQUENCE.store(seed, Ordering::Relaxed);
        overlapped += u64::from(threads::play(&mut seen, &vulkan, other.as_raw().into_raw(), seed, alone));
        seen.sequences += 1;
    }
    seen.tell("of three threads", started);
    println!("in {overlapped} of them the threads took turns");
    assert_eq!(stranger.violations(), [], "the other runtime knows nothing of it");
    assert!(alone || overlapped > seeds.count() as u64 / 10, "the threads ran one after the other");
}

#[test]
fn pictures_on_a_device_that_the_runtime_has_made() {
    let _alone = alone();
    let (seeds, alone) = seeds(EVERYDAY_PICTURES, 20);
    let own = Arc::new(Vulkan::new());
    let (stranger, other) = stranger();
    // A second device would need queues that are asked for.
    let names: Vec<_> = function_names().filter(|name| *name != "xrCreateVulkanDeviceKHR").collect();
    let mut seen = Seen::default();
    let started = Instant::now();
    for seed in seeds {
        SEQUENCE.store(seed, Ordering::Relaxed);
        let mut run = Run::new(&mut seen, Arc::clone(&own), other.as_raw().into_raw(), seed, alone);
        run.graphics = true;
        run.progress = &PICTURES;
        run.begin_with_pictures(seed.is_multiple_of(VALIDATED));
        let most = 40 + run.dice.below(160);
        run.go_on(&names, most);
        run.end();
        run.next_application();
        run.seen.sequences += 1;
    }
    seen.tell("with pictures", started);
    let messages = Vulkan::messages();
    assert!(
        messages.is_empty(),
        "{} messages of the validation layers: {:?}",
        messages.len(),
        messages.first()
    );
    assert_eq!(stranger.violations(), [], "the other runtime knows nothing of it");
    if alone {
        return;
    }
    for name in [
        "xrCreateVulkanInstanceKHR",
        "xrGetVulkanGraphicsDevice2KHR",
        "xrCreateVulkanDeviceKHR",
        "xrCreateSession",
        "xrEnumerateSwapchainImages",
        "xrAcquireSwapchainImage",
        "xrWaitSwapchainImage",
        "xrReleaseSwapchainImage",
        "xrEndFrame",
    ] {
        let times = seen.times(name, R::SUCCESS);
        assert!(times > seen.sequences / 2, "{name} succeeded {times} times only");
    }
    assert!(seen.times("xrEndFrame", R::ERROR_LAYER_INVALID) > 0);
}
