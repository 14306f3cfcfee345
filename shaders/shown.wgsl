// A colour as it is to be stored in the picture (after scene.wgsl), whether or not the target encodes sRGB by itself.
fn shown(colour: vec3<f32>) -> vec3<f32> {
    if scene.encode != 0u {
        return colour;
    }
    return select(pow((colour + 0.055) / 1.055, vec3(2.4)), colour / 12.92, colour <= vec3(0.04045));
}
