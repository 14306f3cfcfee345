//! The pointers an application passes, verified before they are used: null, alignment, `type`, the `next` chain,
//! capacities. `In` and `Out` are as wide as the C pointers and only ever made by a C caller.
#![allow(unsafe_code, reason = "reads and writes memory that a C caller points at")]

use std::ffi::{CStr, c_char, c_void};

use openxr::sys;

use crate::mock::fault::{Outcome, misuse, refusal, require};

/// A `next` chain longer than this is taken for a cycle.
const LONGEST_CHAIN: usize = 256;

/// A structure of the API that begins with `type` and `next`.
///
/// # Safety
/// The structure's layout begins with an XrStructureType and a pointer, and TYPE is its own tag.
pub unsafe trait Typed {
    const TYPE: sys::StructureType;
}

macro_rules! typed {
    ($($name:ident)*) => {
        // SAFETY: the definitions in openxr-sys follow the C header: `ty`, then `next`.
        $(unsafe impl Typed for sys::$name { const TYPE: sys::StructureType = sys::$name::TYPE; })*
    };
}
typed! {
    ApiLayerProperties ExtensionProperties InstanceCreateInfo InstanceProperties SystemGetInfo SystemProperties
    SessionCreateInfo SessionBeginInfo SwapchainCreateInfo SwapchainImageVulkanKHR SwapchainImageAcquireInfo
    SwapchainImageWaitInfo SwapchainImageReleaseInfo ReferenceSpaceCreateInfo ActionSpaceCreateInfo SpaceLocation
    SpaceVelocity SpacesLocateInfo SpaceLocations SpaceVelocities View ViewLocateInfo ViewState ViewConfigurationView
    ViewConfigurationProperties CompositionLayerProjection CompositionLayerProjectionView CompositionLayerQuad
    CompositionLayerCubeKHR CompositionLayerDepthInfoKHR FrameBeginInfo FrameEndInfo FrameWaitInfo FrameState HapticVibration EventDataBuffer
    ActionStateBoolean ActionStateFloat ActionStateVector2f ActionStatePose ActionStateGetInfo HapticActionInfo
    ActionSetCreateInfo ActionCreateInfo InteractionProfileSuggestedBinding SessionActionSetsAttachInfo
    ActionsSyncInfo BoundSourcesForActionEnumerateInfo InputSourceLocalizedNameGetInfo InteractionProfileState
    GraphicsBindingVulkanKHR GraphicsRequirementsVulkanKHR VulkanInstanceCreateInfoKHR VulkanDeviceCreateInfoKHR
    VulkanGraphicsDeviceGetInfoKHR CompositionLayerCylinderKHR SystemUserPresencePropertiesEXT VisibilityMaskKHR
    SystemHandTrackingPropertiesEXT HandTrackerCreateInfoEXT HandJointsLocateInfoEXT HandJointLocationsEXT
    HandJointVelocitiesEXT HandTrackingDataSourceInfoEXT HandTrackingDataSourceStateEXT DebugUtilsMessengerCreateInfoEXT DebugUtilsMessengerCallbackDataEXT
    DebugUtilsObjectNameInfoEXT DebugUtilsLabelEXT
}

/// The last part of a type's name, for sentences.
fn short_name<T>() -> &'static str {
    std::any::type_name::<T>().rsplit("::").next().unwrap_or_default()
}

fn check_pointer<T>(pointer: *const T) -> Outcome<()> {
    require!(!pointer.is_null(), ERROR_VALIDATION_FAILURE, "a pointer to {} is NULL", short_name::<T>());
    require!(
        pointer.is_aligned(),
        ERROR_VALIDATION_FAILURE,
        "a pointer to {} is not aligned",
        short_name::<T>()
    );
    Ok(())
}

/// # Safety
/// `pointer` is null or points at a structure that begins with type and next, as the C caller promises.
unsafe fn check_typed<T>(pointer: *const T, wanted: sys::StructureType) -> Outcome<()> {
    check_pointer(pointer)?;
    // SAFETY: not null, aligned, and every such structure begins like the base structure.
    let base = unsafe { &*pointer.cast::<sys::BaseInStructure>() };
    require!(
        base.ty == wanted,
        ERROR_VALIDATION_FAILURE,
        "the type of {} is {:?}",
        short_name::<T>(),
        base.ty
    );
    // SAFETY: `next` is null or a chain of structures, as the caller promises.
    unsafe { find_in_chain(base.next.cast(), sys::StructureType::UNKNOWN) }.map(|_| ())
}

/// The first structure of a type in a chain; XR_ERROR_VALIDATION_FAILURE when the chain does not end.
///
/// # Safety
/// `next` is null or points at a structure that begins with type and next, and so on.
unsafe fn find_in_chain(
    mut next: *const sys::BaseInStructure,
    wanted: sys::StructureType,
) -> Outcome<Option<*const c_void>> {
    let mut found = None;
    for _ in 0..LONGEST_CHAIN {
        if next.is_null() {
            return Ok(found);
        }
        check_pointer(next)?;
        // SAFETY: not null, aligned, a structure by the caller's promise.
        let base = unsafe { &*next };
        if base.ty == wanted && found.is_none() {
            found = Some(next.cast());
        }
        next = base.next;
    }
    Err(misuse(sys::Result::ERROR_VALIDATION_FAILURE, "a next chain does not end"))
}

/// A pointer to something the application wants read.
#[repr(transparent)]
#[derive(Clone, Copy)]
pub struct In<T>(*const T);

impl<T> In<T> {
    /// Something that a verified structure points at.
    pub fn new(pointer: *const T) -> Self {
        Self(pointer)
    }

    pub fn is_null(&self) -> bool {
        self.0.is_null()
    }
}

impl<T: Typed> In<T> {
    pub fn get(&self) -> Outcome<&T> {
        // SAFETY: the pointer comes from the C caller, who promises null or a structure.
        unsafe {
            check_typed(self.0, T::TYPE)?;
            Ok(&*self.0)
        }
    }

    /// For structures that may be left out.
    pub fn check_optional(&self) -> Outcome<()> {
        if self.is_null() {
            return Ok(());
        }
        self.get().map(|_| ())
    }

    /// A structure in this one's chain.
    pub fn chained<U: Typed>(&self) -> Outcome<Option<&U>> {
        self.get()?;
        // SAFETY: `get` has verified the head; the chain is the C caller's promise.
        unsafe {
            let base = &*self.0.cast::<sys::BaseInStructure>();
            chained(base.next.cast())
        }
    }
}

impl<T: Copy> In<T> {
    /// Something without a type.
    pub fn plain(&self) -> Outcome<T> {
        check_pointer(self.0)?;
        // SAFETY: not null, aligned; the C caller promises an initialised T.
        Ok(unsafe { *self.0 })
    }
}

impl In<c_char> {
    /// A terminated UTF-8 string.
    pub fn text(&self) -> Outcome<&str> {
        check_pointer(self.0)?;
        // SAFETY: not null; a terminated string by the C caller's promise.
        unsafe { CStr::from_ptr(self.0) }
            .to_str()
            .map_err(|_| misuse(sys::Result::ERROR_VALIDATION_FAILURE, "a string is not UTF-8"))
    }
}

/// A structure in a chain.
///
/// # Safety
/// `next` is a chain in the sense of the specification, and outlives `'a`.
pub unsafe fn chained<'a, U: Typed>(next: *const c_void) -> Outcome<Option<&'a U>> {
    // SAFETY: the caller's promise.
    let found = unsafe { find_in_chain(next.cast(), U::TYPE) }?;
    // SAFETY: the structure says that it is a U.
    Ok(found.map(|pointer| unsafe { &*pointer.cast::<U>() }))
}

/// `count` things at a pointer that a verified structure holds.
///
/// # Safety
/// `pointer` is null or points at `count` initialised things that outlive `'a`.
pub unsafe fn array<'a, T>(pointer: *const T, count: u32) -> Outcome<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    check_pointer(pointer)?;
    // SAFETY: not null, aligned; the length is the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count as usize) })
}

/// The verified structure at a pointer that a verified structure holds.
///
/// # Safety
/// `pointer` is null or points at a structure that begins with type and next and outlives `'a`.
pub unsafe fn nested<'a, T: Typed>(pointer: *const T) -> Outcome<&'a T> {
    // SAFETY: the caller's promise.
    unsafe {
        check_typed(pointer, T::TYPE)?;
        Ok(&*pointer)
    }
}

/// `count` verified structures at a pointer that a verified structure holds.
///
/// # Safety
/// As for `array`, of structures that begin with type and next.
pub unsafe fn typed_array<'a, T: Typed>(pointer: *const T, count: u32) -> Outcome<&'a [T]> {
    // SAFETY: the caller's promise.
    let all = unsafe { array(pointer, count) }?;
    for one in all {
        // SAFETY: a reference is a fine pointer.
        unsafe { check_typed(one, T::TYPE) }?;
    }
    Ok(all)
}

/// The strings at a pointer that a verified structure holds.
///
/// # Safety
/// As for `array`, of terminated strings.
pub unsafe fn texts(pointer: *const *const c_char, count: u32) -> Outcome<Vec<String>> {
    // SAFETY: the caller's promise.
    unsafe { array(pointer, count) }?.iter().map(|text| In(*text).text().map(str::to_owned)).collect()
}

/// A terminated UTF-8 string that may be left out.
pub fn optional_text<'a>(pointer: *const c_char) -> Outcome<Option<&'a str>> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: not null; a terminated string that lives through the call, by the C caller's promise.
    unsafe { CStr::from_ptr(pointer) }
        .to_str()
        .map(Some)
        .map_err(|_| misuse(sys::Result::ERROR_VALIDATION_FAILURE, "a string is not UTF-8"))
}

/// A fixed array of characters as a string; `None` if unterminated or not UTF-8.
pub fn fixed_text<const N: usize>(chars: &[c_char; N]) -> Option<&str> {
    // SAFETY: c_char is a byte.
    let bytes = unsafe { &*std::ptr::from_ref(chars).cast::<[u8; N]>() };
    CStr::from_bytes_until_nul(bytes).ok()?.to_str().ok()
}

/// A string as a fixed array of characters, cut if it is too long.
pub fn fixed_chars<const N: usize>(text: &str) -> [c_char; N] {
    let mut chars = [0; N];
    for (to, from) in chars[..N - 1].iter_mut().zip(text.bytes()) {
        *to = from as c_char;
    }
    chars
}

/// A pointer to something the application wants written.
#[repr(transparent)]
#[derive(Clone, Copy)]
pub struct Out<T>(*mut T);

impl<T> Out<T> {
    /// For places without a type: neither null nor misaligned.
    pub fn check(&self) -> Outcome<()> {
        check_pointer(self.0)
    }

    /// A place that a verified structure points at.
    pub fn nested(pointer: *mut T) -> Self {
        Self(pointer)
    }

    /// Writes an array that a verified structure points at, with room for all of it by the caller's count.
    pub fn fill(&self, values: &[T]) -> Outcome<()>
    where
        T: Copy,
    {
        if values.is_empty() {
            return Ok(());
        }
        self.check()?;
        // SAFETY: not null, aligned; the C caller promises as much room as the capacity that was checked.
        unsafe { std::slice::from_raw_parts_mut(self.0, values.len()) }.copy_from_slice(values);
        Ok(())
    }

    /// The i-th place of an array.
    ///
    /// # Safety
    /// There is room for more than `i` things.
    pub unsafe fn offset(&self, i: usize) -> Self {
        // SAFETY: the caller's promise.
        Self(unsafe { self.0.add(i) })
    }

    /// The same place for something smaller.
    pub fn cast<U>(&self) -> Out<U> {
        Out(self.0.cast())
    }

    /// Writes a place that `check` or `check_typed` has accepted; nothing happens at a null pointer.
    pub fn write(&self, value: T) {
        if !self.0.is_null() {
            // SAFETY: the C caller promises room for a T.
            unsafe { self.0.write(value) }
        }
    }
}

impl<T: Typed> Out<T> {
    /// For structures: also the right type and a chain that ends.
    pub fn check_typed(&self) -> Outcome<()> {
        // SAFETY: the C caller promises null or a structure whose type and next are set.
        unsafe { check_typed(self.0, T::TYPE) }
    }

    /// A structure the application has filled in, to be read before it is written.
    pub fn get(&self) -> Outcome<&T> {
        self.check_typed()?;
        // SAFETY: verified just now; the C caller promises that its inputs are set.
        Ok(unsafe { &*self.0 })
    }

    /// The chain of a structure that `check_typed` has accepted.
    pub fn next(&self) -> *mut c_void {
        if self.0.is_null() {
            return std::ptr::null_mut();
        }
        // SAFETY: not null, and the C caller promises that type and next are set.
        unsafe { (*self.0.cast::<sys::BaseOutStructure>()).next.cast() }
    }

    /// A structure in this one's chain, to be written.
    pub fn chained<U: Typed>(&self) -> Outcome<Option<Out<U>>> {
        self.check_typed()?;
        // SAFETY: the chain is the C caller's promise.
        let found = unsafe { find_in_chain(self.next().cast_const().cast(), U::TYPE) }?;
        Ok(found.map(|pointer| Out(pointer.cast_mut().cast())))
    }
}

/// An array the application wants filled by the two-call idiom.
pub struct OutArray<T> {
    pub capacity: u32,
    pub count: Out<u32>,
    pub items: Out<T>,
}

impl<T> OutArray<T> {
    /// Tells the count, and says whether the items are wanted: `Ok(false)` when the capacity is 0.
    fn wanted(&self, len: usize) -> Outcome<bool> {
        self.count.check()?;
        self.count.write(len as u32);
        if self.capacity == 0 {
            return Ok(false);
        }
        if (self.capacity as usize) < len {
            return Err(refusal(
                sys::Result::ERROR_SIZE_INSUFFICIENT,
                format!("room for {} of {len} items", self.capacity),
            ));
        }
        if len > 0 {
            self.items.check()?;
        }
        Ok(true)
    }

    pub fn fill(&self, values: impl ExactSizeIterator<Item = T>) -> Outcome<()> {
        if self.wanted(values.len())? {
            for (i, value) in values.enumerate() {
                // SAFETY: i is below the capacity, which is the room the C caller promises.
                unsafe { self.items.0.add(i).write(value) };
            }
        }
        Ok(())
    }
}

impl OutArray<c_char> {
    /// A string with its terminator.
    pub fn fill_text(&self, text: &str) -> Outcome<()> {
        let bytes: Vec<u8> = text.bytes().chain([0]).collect();
        self.fill(bytes.into_iter().map(|byte| byte as c_char))
    }
}

impl<T: Typed> OutArray<T> {
    /// Fills structures, whose types must be set; `value` gets each one's index and chain.
    pub fn fill_typed(&self, len: usize, value: impl Fn(usize, *mut c_void) -> T) -> Outcome<()> {
        if !self.wanted(len)? {
            return Ok(());
        }
        // SAFETY: len is at most the capacity, which is the room the C caller promises.
        let place = |i: usize| Out(unsafe { self.items.0.add(i) });
        for i in 0..len {
            place(i).check_typed()?;
        }
        for i in 0..len {
            place(i).write(value(i, place(i).next()));
        }
        Ok(())
    }
}
