//! `XR_EXT_debug_utils`: who wants to hear of what goes wrong, and what the application calls its things.

use std::ffi::CString;

use openxr::sys::{
    self, DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Types, Handle as _,
    ObjectType,
};

use super::{State, limit_reached};
use crate::mock::fault::{Fault, Outcome, require};

/// A callback of the application.
#[derive(Clone, Copy)]
pub struct Messenger {
    pub instance: sys::Instance,
    pub severities: Severity,
    pub types: Types,
    pub callback: sys::pfn::DebugUtilsMessengerCallbackEXT,
    /// The address the application wants back.
    pub user_data: usize,
}

impl Messenger {
    pub fn wants(&self, severity: Severity, types: Types) -> bool {
        self.severities.intersects(severity) && self.types.intersects(types)
    }
}

/// An object of the application, and what the application calls it.
#[derive(Clone)]
pub struct Object {
    pub kind: ObjectType,
    pub handle: u64,
    pub name: Option<CString>,
}

/// Something to tell, with all texts owned: nothing is locked while a messenger is called.
pub struct Message {
    pub severity: Severity,
    pub types: Types,
    pub id: CString,
    pub function: CString,
    pub text: CString,
    pub objects: Vec<Object>,
    pub labels: Vec<CString>,
}

/// What a session is doing, in the application's words.
#[derive(Default)]
pub struct Labels {
    regions: Vec<CString>,
    /// Holds until the next label or region.
    single: Option<CString>,
}

impl Labels {
    pub fn begin(&mut self, label: CString) {
        self.single = None;
        self.regions.push(label);
    }

    pub fn end(&mut self) {
        self.single = None;
        self.regions.pop();
    }

    pub fn insert(&mut self, label: CString) {
        self.single = Some(label);
    }

    /// The newest first.
    fn all(&self) -> impl Iterator<Item = &CString> {
        self.single.iter().chain(self.regions.iter().rev())
    }
}

/// A text for C; nothing of it after a zero byte.
pub fn c_text(text: &str) -> CString {
    CString::new(text.split('\0').next().unwrap_or_default()).unwrap_or_default()
}

/// A broken rule, in words for a messenger.
pub fn about(function: &str, fault: &Fault) -> Message {
    Message {
        severity: Severity::ERROR,
        types: Types::VALIDATION,
        id: c_text(&format!("XR_{:?}", fault.code)),
        function: c_text(function),
        text: c_text(&fault.text),
        objects: Vec::new(),
        labels: Vec::new(),
    }
}

impl State {
    pub fn create_messenger(&mut self, messenger: Messenger) -> Outcome<sys::DebugUtilsMessengerEXT> {
        self.messengers.insert(messenger).ok_or_else(limit_reached::<sys::DebugUtilsMessengerEXT>)
    }

    pub fn destroy_messenger(&mut self, handle: sys::DebugUtilsMessengerEXT) -> Outcome<()> {
        self.messengers.remove(handle).map(|_| ())
    }

    /// Who is to hear a message: of one instance, or of all when it is not known whose call it was.
    pub fn listeners(&self, of: Option<sys::Instance>, severity: Severity, types: Types) -> Vec<Messenger> {
        let hears = |it: &&Messenger| of.is_none_or(|of| of == it.instance) && it.wants(severity, types);
        self.messengers.iter().map(|(_, messenger)| messenger).filter(hears).copied().collect()
    }

    /// A broken rule and who is to hear of it; `None` when nobody is.
    pub fn complaint(&self, function: &str, fault: &Fault) -> Option<(Vec<Messenger>, Message)> {
        if self.messengers.is_empty() {
            return None;
        }
        let mut message = about(function, fault);
        let listeners = self.listeners(None, message.severity, message.types);
        message.labels = self.sessions.iter().flat_map(|(_, it)| it.labels.all()).cloned().collect();
        (!listeners.is_empty()).then_some((listeners, message))
    }

    /// Names an object, or forgets its name.
    pub fn name_object(
        &mut self,
        handle: sys::Instance,
        kind: ObjectType,
        object: u64,
        name: Option<CString>,
    ) -> Outcome<()> {
        require!(
            kind != ObjectType::UNKNOWN,
            ERROR_VALIDATION_FAILURE,
            "objectType is XR_OBJECT_TYPE_UNKNOWN"
        );
        require!(object != 0, ERROR_HANDLE_INVALID, "objectHandle is XR_NULL_HANDLE");
        self.check_object(kind, object)?;
        let names = &mut self.instance_mut(handle)?.object_names;
        match name.filter(|name| !name.is_empty()) {
            Some(name) => names.insert((kind.into_raw(), object), name),
            None => names.remove(&(kind.into_raw(), object)),
        };
        Ok(())
    }

    /// Handles of the kinds this runtime makes must be alive.
    fn check_object(&self, kind: ObjectType, raw: u64) -> Outcome<()> {
        match kind {
            ObjectType::INSTANCE => self.instances.get(sys::Instance::from_raw(raw)).map(|_| ()),
            ObjectType::SESSION => self.sessions.get(sys::Session::from_raw(raw)).map(|_| ()),
            ObjectType::SWAPCHAIN => self.swapchains.get(sys::Swapchain::from_raw(raw)).map(|_| ()),
            ObjectType::SPACE => self.spaces.get(sys::Space::from_raw(raw)).map(|_| ()),
            ObjectType::ACTION_SET => self.action_sets.get(sys::ActionSet::from_raw(raw)).map(|_| ()),
            ObjectType::ACTION => self.actions.get(sys::Action::from_raw(raw)).map(|_| ()),
            _ => Ok(()),
        }
    }

    /// What an instance's application calls an object.
    pub fn object_name(&self, handle: sys::Instance, kind: ObjectType, object: u64) -> Option<&CString> {
        self.instances.get(handle).ok()?.object_names.get(&(kind.into_raw(), object))
    }

    /// The labels of those objects that are sessions.
    pub fn labels_of(&self, objects: &[Object]) -> Vec<CString> {
        let sessions = objects.iter().filter(|it| it.kind == ObjectType::SESSION);
        sessions
            .filter_map(|it| self.sessions.get(sys::Session::from_raw(it.handle)).ok())
            .flat_map(|session| session.labels.all())
            .cloned()
            .collect()
    }
}
