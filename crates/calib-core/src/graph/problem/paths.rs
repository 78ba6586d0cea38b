//! Ways through the graph.

use crate::graph::error::Error;
use crate::graph::ids::{EdgeId, FrameId};
use crate::graph::problem::Problem;

impl Problem {
    /// The edges from one frame to another by the shortest way (fewest edges, first created wins).
    ///
    /// # Errors
    /// [`Error::NoPath`] when the frames are not connected.
    pub fn path(&self, from: FrameId, to: FrameId) -> Result<Vec<(EdgeId, bool)>, Error> {
        let mut reached: Vec<Option<(EdgeId, bool, usize)>> = vec![None; self.frames.len()];
        let mut queue = std::collections::VecDeque::from([from.index()]);
        while let Some(here) = queue.pop_front() {
            if here == to.index() {
                break;
            }
            for (i, edge) in self.edges.iter().enumerate() {
                let (p, c) = (edge.parent.index(), edge.child.index());
                let (next, inverse) = if p == here {
                    (c, false)
                } else if c == here {
                    (p, true)
                } else {
                    continue;
                };
                if next != from.index() && reached[next].is_none() {
                    reached[next] = Some((EdgeId::of(i), inverse, here));
                    queue.push_back(next);
                }
            }
        }
        let mut path = Vec::new();
        let mut here = to.index();
        while here != from.index() {
            let Some((edge, inverse, before)) = reached.get(here).copied().flatten() else {
                return Err(Error::NoPath {
                    from: self.frame_name(from).to_owned(),
                    to: self.frame_name(to).to_owned(),
                });
            };
            path.push((edge, inverse));
            here = before;
        }
        path.reverse();
        Ok(path)
    }
}
