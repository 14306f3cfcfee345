// A colour as it is to be stored in the picture (after scene.wgsl and srgb.wgsl), whether or not the target encodes sRGB by itself.
fn shown(colour: vec3<f32>) -> vec3<f32> {
    if scene.encode != 0u {
        return colour;
    }
    return linear_from_srgb(colour);
}
