//! Says what Vulkan, OpenXR and the display offer here, and what to install.
