//! What the operator asks for while a session records.

use super::{Key, Phase, Session};
use crate::session::hold::Hold;
use crate::{Screen, TableError};

/// How often one pose says that its hold starts over: more would push the question off the screen.
const STARTS_OVER: usize = 3;

impl Session<'_> {
    /// Handles the operator's input.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn key(&mut self, key: Key, screen: &mut dyn Screen) -> Result<(), TableError> {
        match (key, self.phase) {
            (Key::There, Phase::Going) if self.is_passing() => self.pass(screen),
            (Key::There, Phase::Going) => self.phase = Phase::Settling,
            (Key::Instead, _) => self.instead(screen)?,
            (Key::Keep, Phase::Settling | Phase::Holding(_)) if self.is_guided() => {
                self.as_it_is = true;
                screen.line("  this pose counts with what is seen of it");
            }
            (Key::Repeat, _) => self.repeat(screen)?,
            (Key::Skip, _) if self.is_guided() => {
                screen.line("  skipped");
                self.give_up_hold()?;
                if let Some(planner) = &mut self.planner {
                    planner.skipped();
                }
                self.next(screen);
            }
            _ => {}
        }
        Ok(())
    }

    /// Whether the requested pose is only on the way.
    pub(super) fn is_passing(&self) -> bool {
        self.step().is_some_and(|step| step.through)
    }

    /// Takes the pose that was held last out of the file, and asks for it again.
    fn repeat(&mut self, screen: &mut dyn Screen) -> Result<(), TableError> {
        let Some(last) = self.last.take() else {
            screen.line("  No pose of this session can be repeated: only the last one, once.");
            return Ok(());
        };
        self.hold = Hold::default();
        self.table.cut_back(last.before)?;
        screen.line(&format!(
            "  Pose {} is out of the file and is recorded again.",
            last.hold
        ));
        self.held -= 1;
        self.done.remove(&last.step);
        self.free = self.free.saturating_sub(1);
        self.step = last.step;
        if let Some(planner) = &mut self.planner {
            planner.forget();
        }
        self.follow();
        (self.as_it_is, self.started_over) = (false, 0);
        self.phase = self.first_phase();
        self.announce(screen);
        Ok(())
    }

    /// Says why the hold starts over, a few times for each pose.
    pub(super) fn starts_over(&mut self, why: &str, screen: &mut dyn Screen) {
        self.started_over += 1;
        if self.started_over <= STARTS_OVER {
            screen.line(why);
        }
        if self.started_over == STARTS_OVER {
            screen.line("  This is not said again for this pose.");
        }
    }
}
