//! What is drawn over the land, placed for a frame.

use std::sync::Arc;

use anyhow::Result;

use super::Painter;
use crate::controllers::Hands;
use crate::gpu::Gpu;
use crate::render::Placed;

impl Painter {
    /// Takes hands, rays and ways over into the frame in flight `index`. Hands that are seen are where they are in this
    /// frame: what was said of them is a frame old.
    ///
    /// # Errors
    /// Out of memory, the first time that there is something.
    pub(crate) fn place_aids(
        &mut self,
        gpu: &Arc<Gpu>,
        index: usize,
        hands: &Hands,
        placed: &Placed,
    ) -> Result<()> {
        for (aid, hand) in self.aids.hands.iter_mut().zip(&hands.hands) {
            if let (Some(aid), Some(grip)) = (aid, hand.grip.or(hand.aim)) {
                aid.grip = grip;
                aid.aim = hand.aim.filter(|_| aid.aim.is_some()).or(aid.aim);
            }
        }
        self.terrain.set_aids(gpu, index, &self.aids, placed)
    }
}
