//! The visibility mask: an octagon in each view, as triangles and as a line.

use openxr::sys::{self, VisibilityMaskTypeKHR};

use super::{config::Mask, pose::Fov};

/// Corners in the plane 1 m before the eye (x to the right, y up), and indices into them.
#[derive(Default)]
pub struct Mesh {
    pub vertices: Vec<sys::Vector2f>,
    pub indices: Vec<u32>,
}

/// The mask of a view with this field of view; `None` for a type that the extension does not have.
pub fn mesh(mask: Mask, fov: Fov, kind: VisibilityMaskTypeKHR) -> Option<Mesh> {
    let cut = match mask {
        Mask::Octagon { cut } => cut.clamp(0.0, 0.5),
        Mask::Empty => 0.0,
    };
    let [left, right, down, up] = [fov.left, fov.right, fov.down, fov.up].map(f32::tan);
    let (x, y) = (cut * (right - left), cut * (up - down));
    let at = |x, y| sys::Vector2f { x, y };
    // Counter-clockwise, from the bottom side's left end: two per corner of the rectangle.
    let octagon = [
        at(left + x, down),
        at(right - x, down),
        at(right, down + y),
        at(right, up - y),
        at(right - x, up),
        at(left + x, up),
        at(left, up - y),
        at(left, down + y),
    ];
    let mesh = match kind {
        VisibilityMaskTypeKHR::VISIBLE_TRIANGLE_MESH => {
            Mesh { vertices: octagon.into(), indices: (1..7).flat_map(|i| [0, i, i + 1]).collect() }
        }
        VisibilityMaskTypeKHR::LINE_LOOP => Mesh { vertices: octagon.into(), indices: (0..8).collect() },
        VisibilityMaskTypeKHR::HIDDEN_TRIANGLE_MESH => {
            let corners = [at(right, down), at(right, up), at(left, up), at(left, down)];
            let triangle = |i: usize| [octagon[(2 * i + 1) % 8], corners[i], octagon[(2 * i + 2) % 8]];
            Mesh { vertices: (0..4).flat_map(triangle).collect(), indices: (0..12).collect() }
        }
        _ => return None,
    };
    Some(if mask == Mask::Empty { Mesh::default() } else { mesh })
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOV: Fov = Fov { left: -0.9, right: 0.7, up: 0.8, down: -0.85 };

    fn area(mesh: &Mesh) -> f32 {
        let corner = |i: &u32| mesh.vertices[*i as usize];
        mesh.indices
            .chunks_exact(3)
            .map(|triangle| {
                let [a, b, c] = [0, 1, 2].map(|i| corner(&triangle[i]));
                let twice = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
                assert!(twice > 0.0, "triangles are counter-clockwise");
                twice / 2.0
            })
            .sum()
    }

    #[test]
    fn hidden_and_visible_make_the_whole_view() {
        let of = |kind| mesh(Mask::Octagon { cut: 0.2 }, FOV, kind).unwrap_or_default();
        let hidden = area(&of(VisibilityMaskTypeKHR::HIDDEN_TRIANGLE_MESH));
        let visible = area(&of(VisibilityMaskTypeKHR::VISIBLE_TRIANGLE_MESH));
        let whole = (FOV.right.tan() - FOV.left.tan()) * (FOV.up.tan() - FOV.down.tan());
        assert!((hidden + visible - whole).abs() < 1e-4 * whole);
        assert!((hidden / whole - 2.0 * 0.2 * 0.2).abs() < 1e-4);
        assert_eq!(of(VisibilityMaskTypeKHR::LINE_LOOP).indices.len(), 8);
    }

    #[test]
    fn an_empty_mask_has_no_vertex() {
        let empty = mesh(Mask::Empty, FOV, VisibilityMaskTypeKHR::HIDDEN_TRIANGLE_MESH);
        assert!(empty.is_some_and(|mesh| mesh.vertices.is_empty() && mesh.indices.is_empty()));
        assert!(mesh(Mask::Empty, FOV, VisibilityMaskTypeKHR::from_raw(0)).is_none());
    }
}
