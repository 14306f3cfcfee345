// The sky behind everything, at depth 0 (infinitely far).

struct SkyVertex {
    @builtin(position) position: vec4<f32>,
    @location(0) direction: vec3<f32>,
}

fn sky_corner(index: u32, view: u32) -> SkyVertex {
    let corner = vec2(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0;
    // Any depth gives a point on the ray; 1 is the near plane.
    let near = scene.views[view].ray_from_clip * vec4(corner, 1.0, 1.0);
    var out: SkyVertex;
    out.position = vec4(corner, 0.0, 1.0);
    out.direction = near.xyz / near.w;
    return out;
}

@vertex
fn sky_vertex(@builtin(vertex_index) index: u32, @builtin(view_index) view: u32) -> SkyVertex {
    return sky_corner(index, view);
}

@vertex
fn sky_vertex_of_eye(@builtin(vertex_index) index: u32) -> SkyVertex {
    return sky_corner(index, eye.view);
}

@fragment
fn sky_fragment(in: SkyVertex) -> @location(0) vec4<f32> {
    return vec4(expose(sky(normalize(in.direction))), 1.0);
}
