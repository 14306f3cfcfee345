//! The shared library comes and goes without a trace: loaded, used, unloaded and loaded again, on many threads at once,
//! it leaves no thread, no instance and no memory behind, and threads that have called it end as they should;
//! negotiation and the calls without an instance work in each life.
#![allow(unsafe_code, reason = "loads a library and calls C functions")]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod foreign_support;

use std::ffi::{CStr, CString};
use std::fs;
use std::mem::transmute;
use std::path::{Path, PathBuf};

use libloading::Library;
use openxr::sys::{self, Handle as _, pfn};

fn threads() -> usize {
    fs::read_dir("/proc/self/task").unwrap().count()
}

/// Bytes of the process in memory.
fn resident() -> u64 {
    let statm = fs::read_to_string("/proc/self/statm").unwrap();
    4096 * statm.split(' ').nth(1).unwrap().parse::<u64>().unwrap()
}

/// A library that has been negotiated with.
struct Loaded {
    gipa: pfn::GetInstanceProcAddr,
    _library: Library,
}

impl Loaded {
    fn new(path: &Path) -> Self {
        // SAFETY: the library has the interface of an OpenXR runtime.
        let (library, answer) = unsafe {
            let library = Library::new(path).unwrap();
            let negotiate = library
                .get::<pfn::NegotiateLoaderRuntimeInterface>(b"xrNegotiateLoaderRuntimeInterface")
                .unwrap();
            let info = sys::NegotiateLoaderInfo {
                struct_type: sys::NegotiateLoaderInfo::TYPE,
                struct_version: sys::NegotiateLoaderInfo::VERSION,
                struct_size: size_of::<sys::NegotiateLoaderInfo>(),
                min_interface_version: 1,
                max_interface_version: 1,
                min_api_version: sys::Version::new(1, 0, 0),
                max_api_version: sys::Version::new(1, 0x3FF, 0xFFF),
            };
            let mut answer = sys::NegotiateRuntimeRequest {
                struct_type: sys::NegotiateRuntimeRequest::TYPE,
                struct_version: sys::NegotiateRuntimeRequest::VERSION,
                struct_size: size_of::<sys::NegotiateRuntimeRequest>(),
                runtime_interface_version: 0,
                runtime_api_version: sys::Version::new(0, 0, 0),
                get_instance_proc_addr: None,
            };
            assert_eq!(negotiate(&info, &mut answer), sys::Result::SUCCESS);
            (library, answer)
        };
        assert_eq!(answer.runtime_interface_version, 1);
        assert_eq!(answer.runtime_api_version, sys::CURRENT_API_VERSION);
        Self { gipa: answer.get_instance_proc_addr.unwrap(), _library: library }
    }

    fn find(&self, instance: sys::Instance, name: &CStr) -> pfn::VoidFunction {
        let mut found = None;
        // SAFETY: a terminated name and a place for the answer.
        let code = unsafe { (self.gipa)(instance, name.as_ptr(), &mut found) };
        assert_eq!(code, sys::Result::SUCCESS, "{name:?}");
        found.unwrap()
    }

    fn count_extensions(&self) -> u32 {
        let mut count = 0;
        // SAFETY: the function of this name has this type.
        let code = unsafe {
            let enumerate: pfn::EnumerateInstanceExtensionProperties =
                transmute(self.find(sys::Instance::NULL, c"xrEnumerateInstanceExtensionProperties"));
            enumerate(std::ptr::null(), 0, &mut count, std::ptr::null_mut())
        };
        assert_eq!(code, sys::Result::SUCCESS);
        count
    }

    fn create_instance(&self) -> sys::Instance {
        // SAFETY: all zero is a create info with nothing in it.
        let mut info: sys::InstanceCreateInfo = unsafe { std::mem::zeroed() };
        info.ty = sys::InstanceCreateInfo::TYPE;
        info.application_info.api_version = sys::Version::new(1, 0, 0);
        let name = CString::new("library test").unwrap();
        for (to, from) in info.application_info.application_name.iter_mut().zip(name.as_bytes()) {
            *to = *from as _;
        }
        let mut instance = sys::Instance::NULL;
        // SAFETY: the function of this name has this type.
        let code = unsafe {
            let create: pfn::CreateInstance = transmute(self.find(sys::Instance::NULL, c"xrCreateInstance"));
            create(&info, &mut instance)
        };
        assert_eq!(code, sys::Result::SUCCESS);
        instance
    }

    fn destroy(&self, instance: sys::Instance) {
        // SAFETY: the function of this name has this type.
        let code = unsafe {
            let destroy: pfn::DestroyInstance = transmute(self.find(instance, c"xrDestroyInstance"));
            destroy(instance)
        };
        assert_eq!(code, sys::Result::SUCCESS);
    }

    /// What the loader's table is filled with: found, whoever the handle belongs to must be alive.
    fn knows(&self, instance: sys::Instance) -> bool {
        let mut found = None;
        // SAFETY: a terminated name and a place for the answer.
        let code = unsafe { (self.gipa)(instance, c"xrPollEvent".as_ptr(), &mut found) };
        assert_eq!(code == sys::Result::SUCCESS, found.is_some());
        assert!(matches!(code, sys::Result::SUCCESS | sys::Result::ERROR_HANDLE_INVALID), "{code:?}");
        found.is_some()
    }
}

/// One life: negotiated with, used or only asked, unloaded. The last handle it gave.
fn live(path: &Path, with_instances: bool, old: sys::Instance) -> sys::Instance {
    let loaded = Loaded::new(path);
    assert!(loaded.count_extensions() > 0);
    assert!(!loaded.knows(old), "a handle of another life is valid");
    if !with_instances {
        return old;
    }
    let (first, second) = (loaded.create_instance(), loaded.create_instance());
    assert_ne!(first, second);
    assert!(loaded.knows(first) && loaded.knows(second));
    loaded.destroy(first);
    assert!(!loaded.knows(first) && loaded.knows(second));
    loaded.destroy(second);
    assert!(!loaded.knows(second));
    second
}

/// The three in a row, since each looks at the whole process.
#[test]
fn it_leaves_no_trace() {
    let path = foreign_support::library();
    it_is_loaded_and_unloaded_again_and_again(&path);
    threads_that_used_it_end_after_it_is_unloaded(&path);
    many_threads_load_it_at_once(&path);
}

fn it_is_loaded_and_unloaded_again_and_again(path: &Path) {
    let mut old = sys::Instance::NULL;
    let mut rounds = |count: u32| {
        for round in 0..count {
            // Some lives are without an instance, as where a loader only asks for extensions.
            old = live(path, round % 3 != 0, old);
        }
    };
    rounds(100);
    let (threads_before, resident_before) = (threads(), resident());
    rounds(2000);
    assert_eq!(threads(), threads_before);
    // A mock is some 100 kB, so 2000 of them would show.
    let resident = resident();
    assert!(resident < resident_before + (8 << 20), "{resident} bytes were {resident_before}");
}

fn threads_that_used_it_end_after_it_is_unloaded(path: &Path) {
    let before = threads();
    // More threads than there are keys for thread-exit hooks in a process.
    for _ in 0..1500 {
        let path = path.to_owned();
        std::thread::spawn(move || live(&path, true, sys::Instance::NULL)).join().unwrap();
    }
    assert_eq!(threads(), before);
}

fn many_threads_load_it_at_once(path: &Path) {
    let before = threads();
    let fold = |path: PathBuf| move || (0..100).fold(sys::Instance::NULL, |old, _| live(&path, true, old));
    let workers: Vec<_> = (0..8).map(|_| std::thread::spawn(fold(path.to_owned()))).collect();
    for worker in workers {
        worker.join().unwrap();
    }
    assert_eq!(threads(), before);
}
