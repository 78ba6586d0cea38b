//! Recordings with faults of a laboratory: labels exchanged in many rows, joints that moved without readings.

use calib_init::mistake::Mistake;
use calib_init::{About, File, Proposal};

use crate::lab::{Design, Kind, file, link_of, proposed, recordings, text, with_cells};

const HAND: [(&str, &str, Kind); 1] = [("hand", "flange", Kind::Markers(4))];

/// Tables in which the markers of every row are those that `order` gives for it, as numbers of markers from 1.
fn relabeled(seed: u64, order: impl Fn(usize) -> [usize; 4]) -> Vec<File> {
    let good = recordings(&HAND, Design::Random, seed);
    let of = |(name, poses): (&String, &calib_recording::Poses)| {
        let mut poses = poses.clone();
        let before = poses.markers.clone();
        for (k, track) in (1..=4).map(|k| format!("hand_{k}")).enumerate() {
            let rows = poses.markers.get_mut(&track).expect("a marker");
            for (row, seen) in rows.iter_mut().enumerate() {
                *seen = before[&format!("hand_{}", order(row)[k])][row];
            }
        }
        file(name, text(&poses))
    };
    good.iter().map(of).collect()
}

fn sigma(proposal: &Proposal) -> Option<f64> {
    proposal.facts.iter().find_map(|fact| match fact.about {
        About::MarkerSigma { sigma, .. } => Some(sigma),
        _ => None,
    })
}

/// Two labels exchanged, or three passed on, in a tenth to four tenths of the rows: one body, with the noise of the tracker.
#[test]
fn exchanged_labels_do_not_split_a_body() {
    const PASSED_ON: [usize; 4] = [2, 3, 4, 1];
    const EXCHANGED: [usize; 4] = [2, 1, 3, 4];
    for (seed, of_ten) in (301..).zip([1, 3, 4]) {
        for wrong in [EXCHANGED, PASSED_ON] {
            let files = relabeled(seed, |row| match (row * 7 + 3) % 10 < of_ten {
                true => wrong,
                false => [1, 2, 3, 4],
            });
            let proposal = proposed(&files);
            let case = format!("{of_ten} {wrong:?}: {:?}", proposal.facts);
            assert_eq!(proposal.bodies.len(), 1, "{case}");
            assert_eq!(link_of(&proposal, "hand"), "link_6", "{case}");
            let sigma = sigma(&proposal).expect("markers that scatter");
            assert!((1e-4..4e-4).contains(&sigma), "{case}");
            let is_said = |about: &About| matches!(about, About::LabelsExchanged { .. });
            assert!(proposal.facts.iter().any(|f| is_said(&f.about)), "{case}");
        }
    }
}

/// Labels at random in every row: no distance says which is right, and what the markers seem to scatter is no noise.
#[test]
fn labels_at_random_are_no_noise_of_the_tracker() {
    let orders = [
        [1, 2, 3, 4],
        [2, 1, 4, 3],
        [3, 4, 1, 2],
        [4, 3, 2, 1],
        [2, 3, 4, 1],
        [3, 1, 2, 4],
        [4, 1, 3, 2],
    ];
    let proposal = proposed(&relabeled(311, |row| orders[row % orders.len()]));
    assert!(
        sigma(&proposal).is_none_or(|s| s < 1e-3),
        "{:?}",
        proposal.facts
    );
    assert!(proposal.noise.marker.is_none_or(|s| s < 1e-3));
}

/// One wild sample in a table is no noise either.
#[test]
fn a_wild_sample_is_no_noise_of_the_tracker() {
    let good = recordings(&HAND, Design::Random, 312);
    let files: Vec<File> = good
        .iter()
        .map(|(name, poses)| {
            let mut poses = poses.clone();
            let seen = poses.markers.get_mut("hand_2").expect("a marker")[5].as_mut();
            if let Some(seen) = seen {
                seen.x += 0.04;
            }
            file(name, text(&poses))
        })
        .collect();
    let sigma = sigma(&proposed(&files)).expect("markers that scatter");
    assert!((1e-4..4e-4).contains(&sigma), "{sigma}");
}

/// A joint that moved without a column, or with one that says 0, is named wherever it is in the chain, and no other mistake.
#[test]
fn a_joint_that_moved_without_readings_is_named() {
    for joint in (1..=6).map(|j| format!("joint_{j}")) {
        let column = format!("{joint}_deg");
        for stuck in [true, false] {
            let good = recordings(&HAND, Design::Random, 321);
            let of = |(name, poses): (&String, &calib_recording::Poses)| {
                let mut poses = poses.clone();
                if !stuck {
                    poses.joints.remove(&joint);
                }
                let still = |c: &str, cell: &str| match c == column {
                    true => "0".to_owned(),
                    false => cell.to_owned(),
                };
                file(name, with_cells(&text(&poses), still))
            };
            let files: Vec<File> = good.iter().map(of).collect();
            let proposal = proposed(&files);
            let mistakes = proposal.facts.iter().filter_map(|fact| match &fact.about {
                About::NotCorrected { mistake, .. } | About::Corrected { mistake, .. } => {
                    Some(mistake)
                }
                _ => None,
            });
            let wanted = Mistake::MissingColumn {
                joint: joint.clone(),
            };
            assert_eq!(
                mistakes.collect::<Vec<_>>(),
                [&wanted],
                "{stuck}: {:?}",
                proposal.facts
            );
            assert_eq!(link_of(&proposal, "hand"), "link_6");
        }
    }
}
