//! The loop over the tracker, the joints and the operator.

use super::{CaptureError, Ended, Key, Phase, Session};
use crate::{Input, JointListener, JointSource, Screen, Source};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

impl Session<'_> {
    /// Records until the session ends; then all rows are on disk.
    ///
    /// `clock` is the monotonic time of this computer, s; `keys` the operator's input.
    ///
    /// # Errors
    /// [`CaptureError`].
    pub fn record(
        &mut self,
        source: &mut Source,
        listener: &mut Option<JointListener>,
        keys: &Receiver<Key>,
        clock: &dyn Fn() -> f64,
        screen: &mut dyn Screen,
    ) -> Result<Ended, CaptureError> {
        let ended = self.until_end(source, listener, keys, clock, screen);
        self.give_up_hold()?;
        self.table.flush()?;
        ended
    }

    fn until_end(
        &mut self,
        source: &mut Source,
        listener: &mut Option<JointListener>,
        keys: &Receiver<Key>,
        clock: &dyn Fn() -> f64,
        screen: &mut dyn Screen,
    ) -> Result<Ended, CaptureError> {
        let began = clock();
        let (mut heard, mut warned) = (began, began);
        let mut keys_open = true;
        self.announce(screen);
        loop {
            let input = source.next(Duration::from_millis(50))?;
            let now = clock();
            if let Some(listener) = listener {
                listener.take(now);
            }
            match input {
                Input::Frames(frames) => {
                    for frame in &frames {
                        heard = now;
                        self.frame(frame, now, listener.as_ref(), screen)?;
                    }
                }
                Input::Foreign(why) => self.foreign(&why, screen),
                Input::Closed => return Ok(Ended::Closed),
                Input::Nothing => {}
            }
            self.table.tick(now)?;
            while keys_open {
                match keys.try_recv() {
                    Ok(Key::Quit) => return Ok(Ended::Quit),
                    Ok(Key::Interrupt) => return Ok(Ended::Interrupted),
                    Ok(Key::Closed) => keys_open = false,
                    Ok(key) => self.key(key, screen)?,
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => keys_open = false,
                }
            }
            if self.reached {
                return Ok(Ended::Reached);
            }
            if self.is_finished() {
                return Ok(Ended::Finished);
            }
            if self.restarted {
                return Ok(Ended::Restarted);
            }
            let waits = self.phase == Phase::Going && self.plan.joints == JointSource::Targets;
            if !keys_open && waits {
                return Ok(Ended::NobodyThere);
            }
            if self
                .plan
                .longest
                .is_some_and(|longest| now - began >= longest)
            {
                return Ok(Ended::TimeIsOver);
            }
            let silent = now - heard;
            if silent >= self.plan.patience {
                return Ok(Ended::Silent(silent));
            }
            if silent >= 2.0 && now - warned >= 5.0 {
                warned = now;
                screen.line(&format!("no data from the tracker for {silent:.0} s"));
            }
            screen.status(&self.status(now), now);
        }
    }
}
