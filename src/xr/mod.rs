//! xr
