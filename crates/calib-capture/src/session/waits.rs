//! Why a pose is not held yet.

use super::{Phase, Session};
use crate::{JointListener, JointSource};

/// What a pose waits for.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Waits {
    /// The operator: joint values are not measured.
    Key,
    /// The robot sends no value of this joint, for so long, s; what it sends instead.
    NoValue {
        joint: String,
        since: Option<f64>,
        heard: String,
    },
    /// A measured joint is not where it was asked to be.
    Joint {
        joint: String,
        at: String,
        asked: String,
    },
    /// This body or marker moves, by so much within the window, m and rad.
    Moves(String, f64, f64),
    /// Nothing that is recorded is seen.
    NothingSeen,
    /// Swept bodies are hidden.
    Hidden(Vec<String>),
}

impl std::fmt::Display for Waits {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Key => f.write_str("press Enter at the pose"),
            Self::NoValue {
                joint,
                since,
                heard,
            } => {
                write!(f, "no value of {joint}")?;
                if let Some(since) = since {
                    write!(f, " for {since:.0} s")?;
                }
                write!(f, " (heard: {heard})")
            }
            Self::Joint { joint, at, asked } => write!(f, "{joint} is at {at}, asked {asked}"),
            Self::Moves(name, far, turned) => write!(
                f,
                "{name} moves: {:.1} mm, {:.1}°",
                far * 1e3,
                turned.to_degrees()
            ),
            Self::NothingSeen => f.write_str("nothing is seen"),
            Self::Hidden(names) => write!(f, "{} is hidden", names.join(", ")),
        }
    }
}

impl Session<'_> {
    /// Why nothing is held now.
    pub(super) fn waiting(
        &self,
        quiet: Option<f64>,
        hidden: Vec<String>,
        host: f64,
        listener: Option<&JointListener>,
    ) -> Option<Waits> {
        match self.phase {
            Phase::Going if self.plan.joints == JointSource::Targets => Some(Waits::Key),
            Phase::Going => self.away(host, listener),
            Phase::Settling if !hidden.is_empty() && !self.as_it_is => Some(Waits::Hidden(hidden)),
            Phase::Settling if quiet.is_none() => Some(match self.still.moving() {
                Some((from, far, turned)) => {
                    let watched = self.plan.watched.iter().find(|w| w.from == from);
                    let name = watched.map_or(from.clone(), |w| w.name.clone());
                    Waits::Moves(name, far, turned)
                }
                None => Waits::NothingSeen,
            }),
            _ => None,
        }
    }

    /// The guided joint that is farthest from its target, or of which nothing is known.
    fn away(&self, host: f64, listener: Option<&JointListener>) -> Option<Waits> {
        let step = self.step()?;
        let guided = self.plan.guide.joints.iter().zip(&step.targets);
        let mut farthest: Option<(f64, Waits)> = None;
        for (&column, &target) in guided {
            let joint = &self.plan.columns[column];
            let Some(q) = self.joint(column, host, listener) else {
                return Some(Waits::NoValue {
                    joint: joint.name.clone(),
                    since: listener.and_then(|l| l.age(&joint.name, host)),
                    heard: listener.map_or_else(|| "nothing".to_owned(), JointListener::heard),
                });
            };
            let off = (q - target).abs() / self.near(column);
            if off > 1.0 && farthest.as_ref().is_none_or(|(most, _)| off > *most) {
                let waits = Waits::Joint {
                    joint: joint.name.clone(),
                    at: joint.unit.shown(q),
                    asked: joint.unit.shown(target),
                };
                farthest = Some((off, waits));
            }
        }
        farthest.map(|(_, waits)| waits)
    }
}
