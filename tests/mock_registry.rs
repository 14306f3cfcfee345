//! The tables made from the OpenXR registry are sound, agree with the crate's bindings, and are what the runtime goes by.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "instances of arbitrary extensions need the raw functions")]

use std::{
    collections::HashSet,
    ffi::{CString, c_char},
    mem::{MaybeUninit, transmute},
    ptr,
};

use fathomless::mock::{
    Mock, MockConfig, function_names,
    registry::{self, Kind, Needs, PROFILES},
};
use openxr::sys::{self, Handle as _, Result as R};

/// An instance of some version and extensions, made through the raw functions.
struct Raw {
    mock: Mock,
    instance: sys::Instance,
}

impl Raw {
    fn new(mock: Mock, minor: u16, extensions: &[&str]) -> Result<Self, R> {
        let names: Vec<_> = extensions.iter().map(|name| CString::new(*name).unwrap()).collect();
        let pointers: Vec<_> = names.iter().map(|name| name.as_ptr()).collect();
        let mut application_name = [0; sys::MAX_APPLICATION_NAME_SIZE];
        application_name[0] = b'x' as c_char;
        let info = sys::InstanceCreateInfo {
            ty: sys::InstanceCreateInfo::TYPE,
            next: ptr::null(),
            create_flags: sys::InstanceCreateFlags::EMPTY,
            application_info: sys::ApplicationInfo {
                application_name,
                application_version: 0,
                engine_name: [0; sys::MAX_ENGINE_NAME_SIZE],
                engine_version: 0,
                api_version: sys::Version::new(1, minor, 0),
            },
            enabled_api_layer_count: 0,
            enabled_api_layer_names: ptr::null(),
            enabled_extension_count: pointers.len() as u32,
            enabled_extension_names: pointers.as_ptr(),
        };
        let mut raw = Self { mock, instance: sys::Instance::NULL };
        // SAFETY: the function has this type.
        let create: sys::pfn::CreateInstance = unsafe { transmute(raw.look_up("xrCreateInstance").unwrap()) };
        // SAFETY: a verified function and whole structures.
        match unsafe { create(&info, &mut raw.instance) } {
            R::SUCCESS => Ok(raw),
            code => Err(code),
        }
    }

    fn look_up(&self, name: &str) -> Result<sys::pfn::VoidFunction, R> {
        let get = self.mock.get_instance_proc_addr().unwrap();
        let name = CString::new(name).unwrap();
        let mut function = None;
        // SAFETY: a terminated name and a place for the function.
        match unsafe { get(self.instance, name.as_ptr(), &mut function) } {
            R::SUCCESS => Ok(function.unwrap()),
            code => {
                assert!(function.is_none());
                Err(code)
            }
        }
    }
}

impl Drop for Raw {
    fn drop(&mut self) {
        if self.instance == sys::Instance::NULL {
            return;
        }
        // SAFETY: the function has this type; nothing is used afterwards.
        unsafe {
            let destroy: sys::pfn::DestroyInstance = transmute(self.look_up("xrDestroyInstance").unwrap());
            assert_eq!(destroy(self.instance), R::SUCCESS);
        }
    }
}

fn offered_extensions(mock: &Mock) -> Vec<(String, u32)> {
    let entry = mock.entry().unwrap();
    let fp = entry.fp();
    let mut count = 0;
    // SAFETY: the two-call idiom with places for every structure.
    unsafe {
        (fp.enumerate_instance_extension_properties)(ptr::null(), 0, &mut count, ptr::null_mut());
        let mut all = vec![
            sys::ExtensionProperties {
                ty: sys::ExtensionProperties::TYPE,
                next: ptr::null_mut(),
                extension_name: [0; sys::MAX_EXTENSION_NAME_SIZE],
                extension_version: 0,
            };
            count as usize
        ];
        let code =
            (fp.enumerate_instance_extension_properties)(ptr::null(), count, &mut count, all.as_mut_ptr());
        assert_eq!(code, R::SUCCESS);
        all.iter().map(|it| (text(&it.extension_name), it.extension_version)).collect()
    }
}

fn text(chars: &[c_char]) -> String {
    chars.iter().take_while(|c| **c != 0).map(|c| *c as u8 as char).collect()
}

fn assert_known(needs: Needs) {
    assert!(!needs.is_empty() && needs.iter().all(|all| !all.is_empty()));
    for need in needs.iter().copied().flatten() {
        let known = ["XR_VERSION_1_0", "XR_VERSION_1_1"].contains(need)
            || registry::EXTENSIONS.iter().any(|extension| extension.name == *need);
        assert!(known, "{need}");
    }
}

#[test]
fn profiles_are_sound() {
    let mut paths = HashSet::new();
    let mut components = 0;
    for profile in PROFILES {
        assert!(paths.insert(profile.path), "{} twice", profile.path);
        assert_eq!(profile.path.split('/').count(), 4, "{}", profile.path);
        assert!(profile.path.starts_with("/interaction_profiles/"));
        assert!(!profile.title.is_empty() && !profile.user_paths.is_empty());
        assert!(profile.user_paths.iter().all(|path| path.starts_with("/user/")));
        assert_known(profile.needs);
        let mut seen = HashSet::new();
        for component in profile.components {
            components += 1;
            let place = format!("{} {}", profile.path, component.subpath);
            assert_known(component.needs);
            assert!(component.user_path.is_none_or(|path| profile.user_paths.contains(&path)), "{place}");
            for user_path in profile.user_paths.iter().filter(|path| component.is_at(path)) {
                assert!(seen.insert((*user_path, component.subpath)), "{place} twice");
                let full = format!("{user_path}{}", component.subpath);
                assert_eq!(profile.split(&full), Some((*user_path, component.subpath)));
                let found = profile.component(user_path, component.subpath).unwrap();
                assert!(ptr::eq(found, component), "{place}");
            }
            assert!(component.subpath.starts_with(component.identifier()));
            let is_output = component.subpath.starts_with("/output/");
            assert_eq!(is_output, component.kind == Kind::Haptic, "{place}");
            assert!(is_output || component.subpath.starts_with("/input/"), "{place}");
            assert_eq!(component.subpath.ends_with("/pose"), component.kind == Kind::Pose, "{place}");
            let leaf = component.subpath.rsplit('/').next().unwrap();
            if ["click", "touch"].contains(&leaf) {
                assert_eq!(component.kind, Kind::Boolean, "{place}");
            }
            if ["x", "y", "force"].contains(&leaf) {
                let is_button = component.identifier() == component.subpath.trim_end_matches("/click");
                assert!(component.kind == Kind::Float || is_button, "{place}");
            }
        }
    }
    assert!(PROFILES.len() > 30 && components > 800, "{} {components}", PROFILES.len());
    let touch = registry::profile("/interaction_profiles/oculus/touch_controller").unwrap();
    assert_eq!(touch.component("/user/hand/left", "/input/x/click").unwrap().kind, Kind::Boolean);
    assert!(touch.component("/user/hand/right", "/input/x/click").is_none());
}

/// Sorted, without repetition, and where the bindings know the number they know it by the same name.
fn check_names(table: &'static [(i32, &str)], prefix: &str, known: impl Fn(i32) -> String) -> usize {
    assert!(table.is_sorted_by_key(|(number, _)| *number));
    assert!(table.windows(2).all(|pair| pair[0].0 != pair[1].0));
    let mut agreeing = 0;
    for (number, name) in table {
        assert_eq!(registry::name(table, *number), Some(*name));
        let theirs = known(*number);
        if theirs.parse::<i64>().is_err() {
            assert_eq!(format!("{prefix}{theirs}"), *name);
            agreeing += 1;
        }
    }
    agreeing
}

#[test]
fn names_agree_with_the_bindings() {
    let results = check_names(registry::RESULTS, "XR_", |n| format!("{:?}", sys::Result::from_raw(n)));
    let types = check_names(registry::STRUCTURE_TYPES, "XR_TYPE_", |n| {
        format!("{:?}", sys::StructureType::from_raw(n))
    });
    let objects = check_names(registry::OBJECT_TYPES, "XR_OBJECT_TYPE_", |n| {
        format!("{:?}", sys::ObjectType::from_raw(n))
    });
    assert!(results > 100 && types > 400 && objects > 30, "{results} {types} {objects}");
    assert_eq!(registry::name(registry::RESULTS, 123_456), None);
}

#[test]
fn the_runtime_says_the_names_of_the_registry() {
    let raw = Raw::new(Mock::default(), 0, &[]).unwrap();
    // SAFETY: the functions have these types.
    let (result, structure) = unsafe {
        (
            transmute::<sys::pfn::VoidFunction, sys::pfn::ResultToString>(
                raw.look_up("xrResultToString").unwrap(),
            ),
            transmute::<sys::pfn::VoidFunction, sys::pfn::StructureTypeToString>(
                raw.look_up("xrStructureTypeToString").unwrap(),
            ),
        )
    };
    let say_result = |number: i32| {
        let mut out = MaybeUninit::<[c_char; 64]>::uninit();
        // SAFETY: room for the 64 characters that the function writes.
        unsafe {
            assert_eq!(
                result(raw.instance, sys::Result::from_raw(number), out.as_mut_ptr().cast()),
                R::SUCCESS
            );
            text(&out.assume_init())
        }
    };
    let say_type = |number: i32| {
        let mut out = MaybeUninit::<[c_char; 64]>::uninit();
        let number = sys::StructureType::from_raw(number);
        // SAFETY: room for the 64 characters that the function writes.
        unsafe {
            assert_eq!(structure(raw.instance, number, out.as_mut_ptr().cast()), R::SUCCESS);
            text(&out.assume_init())
        }
    };
    for (number, name) in registry::RESULTS {
        assert_eq!(say_result(*number), name[..name.len().min(63)]);
    }
    for (number, name) in registry::STRUCTURE_TYPES {
        assert_eq!(say_type(*number), name[..name.len().min(63)]);
    }
    assert_eq!(say_result(-123_456), "XR_UNKNOWN_FAILURE_-123456");
    assert_eq!(say_result(123_456), "XR_UNKNOWN_SUCCESS_123456");
    assert_eq!(say_type(123_456), "XR_UNKNOWN_STRUCTURE_TYPE_123456");
}

#[test]
fn functions_are_there_when_the_registry_offers_them() {
    let own: HashSet<_> = function_names().collect();
    for name in &own {
        let command = registry::command(name).unwrap();
        assert!(command.successes.contains(&0) && command.successes.iter().all(|code| *code >= 0), "{name}");
        assert!(command.errors.len() > 1 && command.errors.iter().all(|code| *code < 0), "{name}");
    }
    for command in registry::COMMANDS {
        let codes = command.successes.iter().chain(command.errors);
        for code in codes {
            assert!(registry::name(registry::RESULTS, *code).is_some(), "{} {code}", command.name);
        }
    }
    let offered = offered_extensions(&Mock::default());
    let all: Vec<_> = offered.iter().map(|(name, _)| name.as_str()).collect();
    let one_each = all.iter().map(std::slice::from_ref);
    for extensions in [&[][..], &all].into_iter().chain(one_each) {
        for minor in [0, 1] {
            let has = |name: &str| extensions.contains(&name);
            let missing_need = extensions.iter().any(|name| {
                let extension = registry::EXTENSIONS.iter().find(|it| it.name == *name).unwrap();
                !registry::is_offered(extension.needs, (1, minor), has)
            });
            if missing_need {
                continue;
            }
            let raw = Raw::new(Mock::default(), minor, extensions).unwrap();
            for command in registry::COMMANDS {
                let expected =
                    own.contains(command.name) && registry::is_offered(command.needs, (1, minor), has);
                let got = raw.look_up(command.name);
                assert_eq!(got.is_ok(), expected, "{} in 1.{minor} with {extensions:?}", command.name);
                assert!(got.is_ok() || got.err() == Some(R::ERROR_FUNCTION_UNSUPPORTED));
            }
        }
    }
}

#[test]
fn extensions_are_those_of_the_registry() {
    let offered = offered_extensions(&Mock::default());
    let mut only_paths = 0;
    for (name, version) in &offered {
        let extension = registry::EXTENSIONS.iter().find(|it| it.name == name).unwrap();
        assert!((1..=extension.version).contains(version), "{name} {version}");
        only_paths += usize::from(extension.only_paths);
        for minor in [0, 1] {
            let code = Raw::new(Mock::default(), minor, &[name.as_str()]).err();
            let alone = registry::is_offered(extension.needs, (1, minor), |_| false);
            let wanted = (!alone).then_some(R::ERROR_EXTENSION_DEPENDENCY_NOT_ENABLED);
            assert_eq!(code, wanted, "{name} alone in 1.{minor}");
        }
    }
    let all: Vec<_> = offered.iter().map(|(name, _)| name.as_str()).collect();
    assert!(Raw::new(Mock::default(), 0, &all).is_ok());
    assert!(only_paths >= 10, "{only_paths}");
    assert_eq!(
        Raw::new(Mock::default(), 1, &["XR_EXT_nonsense"]).err(),
        Some(R::ERROR_EXTENSION_NOT_PRESENT)
    );
    let config =
        MockConfig { absent_extensions: vec!["XR_EXT_palm_pose".to_owned()], ..MockConfig::default() };
    let got = Raw::new(Mock::new(config), 1, &["XR_EXT_palm_pose"]).err();
    assert_eq!(got, Some(R::ERROR_EXTENSION_NOT_PRESENT));
}

#[test]
fn an_extension_needs_what_it_depends_on() {
    let [hands, source] = ["XR_EXT_hand_tracking", "XR_EXT_hand_tracking_data_source"];
    let make = |extensions: &[&str]| Raw::new(Mock::default(), 1, extensions).err();
    assert_eq!(make(&[source]), Some(R::ERROR_EXTENSION_DEPENDENCY_NOT_ENABLED));
    assert_eq!(make(&[source, "XR_EXT_palm_pose"]), Some(R::ERROR_EXTENSION_DEPENDENCY_NOT_ENABLED));
    // In any order.
    assert_eq!((make(&[source, hands]), make(&[hands, source]), make(&[hands])), (None, None, None));
    // What is not there at all comes first.
    assert_eq!(make(&[source, "XR_EXT_nonsense"]), Some(R::ERROR_EXTENSION_NOT_PRESENT));
    // A runtime without the one does not offer the other.
    let without = MockConfig { absent_extensions: vec![hands.to_owned()], ..MockConfig::default() };
    let offered = offered_extensions(&Mock::new(without.clone()));
    assert!(offered.iter().all(|(name, _)| name != hands && name != source));
    assert_eq!(Raw::new(Mock::new(without), 1, &[source]).err(), Some(R::ERROR_EXTENSION_NOT_PRESENT));
}

#[test]
fn what_is_offered() {
    let none = |_: &str| false;
    let palm = |name: &str| name == "XR_EXT_palm_pose";
    let profile = |path: &str| registry::profile(path).unwrap();
    let simple = profile("/interaction_profiles/khr/simple_controller");
    let cosmos = profile("/interaction_profiles/htc/vive_cosmos_controller");
    assert!(registry::is_offered(simple.needs, (1, 0), none));
    assert!(
        !registry::is_offered(cosmos.needs, (1, 0), none) && registry::is_offered(cosmos.needs, (1, 1), none)
    );
    assert!(registry::is_offered(cosmos.needs, (1, 0), |name| name
        == "XR_HTC_vive_cosmos_controller_interaction"));
    let needs = |subpath: &str| simple.component("/user/hand/left", subpath).unwrap().needs;
    assert!(registry::is_offered(needs("/input/select/click"), (1, 0), none));
    assert!(!registry::is_offered(needs("/input/grip_surface/pose"), (1, 0), none));
    assert!(registry::is_offered(needs("/input/grip_surface/pose"), (1, 1), none));
    assert!(!registry::is_offered(needs("/input/palm_ext/pose"), (1, 1), none));
    assert!(registry::is_offered(needs("/input/palm_ext/pose"), (1, 0), palm));
}
