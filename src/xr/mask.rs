//! The parts of the eyes' pictures that nobody sees, since the lenses or the frame of the headset hide them.

use glam::Vec2;
use openxr::sys;

use super::error::Error;
use super::outcome::Outcome;
use super::session::Session;

/// For each eye the triangles that are hidden, three corners each, wound in any way: tangents of the angles to the right
/// and upwards from the eye's −z axis. Empty where nothing is.
pub type HiddenAreas = [Vec<Vec2>; 2];

impl Session {
    /// The next call of [`Session::hidden_areas`] gives them as news.
    pub fn ask_hidden_areas_again(&mut self) {
        self.mask_due = self.asks_for_mask;
    }

    /// What is hidden, where that is news: in the first call of a session that asks for it ([`SessionConfig::mask`]), and
    /// when the runtime has said that it changes.
    ///
    /// # Errors
    /// Losses; a runtime that cannot say what is hidden hides nothing.
    ///
    /// [`SessionConfig::mask`]: super::SessionConfig::mask
    pub fn hidden_areas(&mut self) -> Result<Option<HiddenAreas>, Error> {
        if !std::mem::take(&mut self.mask_due) {
            return Ok(None);
        }
        let mut areas = HiddenAreas::default();
        for (eye, area) in (0..).zip(&mut areas) {
            match self.raw.hidden_area(eye) {
                Ok(mesh) => {
                    *area = mesh.map_or_else(Vec::new, |mesh| triangles(&mesh.corners, &mesh.indices))
                }
                Err(error) if error.outcome() == Outcome::GoOn => {
                    tracing::warn!("what eye {eye} cannot see is drawn too: {error}");
                }
                Err(error) => return Err(error),
            }
        }
        Ok(Some(areas))
    }
}

/// The corners by triangles, without those triangles whose corners are not there.
fn triangles(corners: &[sys::Vector2f], indices: &[u32]) -> Vec<Vec2> {
    let corner = |&index: &u32| {
        let corner = corners.get(index as usize).map(|v| Vec2::new(v.x, v.y));
        corner.filter(|corner| corner.is_finite())
    };
    let whole = indices
        .chunks_exact(3)
        .filter_map(|three| Some([corner(&three[0])?, corner(&three[1])?, corner(&three[2])?]));
    whole.flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_becomes_triangles_and_rubbish_is_left_out() {
        let at = |x, y| sys::Vector2f { x, y };
        let corners = [at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(f32::NAN, 0.0)];
        assert_eq!(triangles(&corners, &[2, 1, 0]), [Vec2::Y, Vec2::X, Vec2::ZERO]);
        assert_eq!(triangles(&corners, &[]), []);
        for wrong in [&[0, 1, 4][..], &[0, 1, 3], &[0, 1]] {
            assert_eq!(triangles(&corners, wrong), [], "{wrong:?}");
        }
    }
}
