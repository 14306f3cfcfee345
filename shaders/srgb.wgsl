// Linear light of sRGB, both 0 to 1: the twin of linear_from_share in src/world/mod.rs (IEC 61966-2-1).
fn linear_from_srgb(colour: vec3<f32>) -> vec3<f32> {
    return select(pow((colour + 0.055) / 1.055, vec3(2.4)), colour / 12.92, colour <= vec3(0.04045));
}
