//! Where a struct's members lie, on the shader's side and on Rust's, so that a test can compare the two.

/// One member of a struct.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Member {
    /// Its name.
    pub name: String,
    /// Bytes from the struct's start.
    pub offset: u32,
    /// Bytes; 0 for an array whose length is only known at run time.
    pub size: u32,
}

/// A struct's size and members, in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StructLayout {
    /// Bytes, as an array's element.
    pub size: u32,
    /// In order of offset.
    pub members: Vec<Member>,
}

/// Bytes of the field that `get` returns: for [`rust_layout!`](crate::rust_layout).
pub fn field_size<T, F>(_get: fn(&T) -> &F) -> u32 {
    size_of::<F>() as u32
}

/// The [`StructLayout`] of a `#[repr(C)]` struct: `rust_layout!(Tile { slot, corner })`, leaving out its padding,
/// to be compared with [`Shader::layout`](crate::gpu::Shader::layout).
#[macro_export]
macro_rules! rust_layout {
    ($kind:ty { $($field:ident),+ $(,)? }) => {
        $crate::gpu::StructLayout {
            size: ::std::mem::size_of::<$kind>() as u32,
            members: vec![$($crate::gpu::Member {
                name: stringify!($field).to_owned(),
                offset: ::std::mem::offset_of!($kind, $field) as u32,
                size: $crate::gpu::field_size(|value: &$kind| &value.$field),
            }),+],
        }
    };
}
