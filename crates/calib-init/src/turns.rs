//! Orientations whose columns may be read in several ways: the way with which bodies follow the robot.

use calib_checks::structural::Chain;
use calib_recording::{BodyColumns, Poses};
use calib_urdf::RobotModel;

use crate::bodies::Found;
use crate::error::InitError;
use crate::fact::{About, CERTAIN, Fact, Notation, Place, TurnsHow};
use crate::links::Scene;
use crate::source::Source;

/// Bodies with what is read, and what was found of it.
pub(crate) struct Chosen {
    /// All files, each as it is read now; `None`: as before.
    pub sources: Option<Vec<Source>>,
    /// How each is read.
    facts: Vec<Fact>,
}

impl Chosen {
    /// How the bodies are read that were not left out.
    pub fn of(self, found: &[Found]) -> Vec<Fact> {
        let is_found = |fact: &Fact| {
            let mut places = found.iter().map(|body| Place::Body(body.name.clone()));
            places.any(|place| place == fact.place)
        };
        self.facts.into_iter().filter(is_found).collect()
    }
}

/// Residuals of all bodies, rms, m, each on the link that it follows best; `None` where none can be told.
fn residuals(model: &RobotModel, found: &[Found], tables: &[Poses]) -> Vec<Option<f64>> {
    let scene = Scene::new(model, found, tables);
    let chain = Chain::from_model(model).ok();
    let of = |body| scene.choose(chain.as_ref()?, body).map(|choice| choice.rms);
    (0..found.len()).map(of).collect()
}

/// Reads each body's orientation in the way with which it follows the robot, where the motion shows one; else in the usual way.
///
/// `tables` makes the recordings' poses from files; `before`: the poses as files are read now.
///
/// # Errors
/// Those of reading a file again, and of `tables`.
pub(crate) fn by_motion(
    model: &RobotModel,
    sources: &[Source],
    found: &[Found],
    before: &[Poses],
    tables: &mut impl FnMut(&[Source]) -> Result<Vec<Poses>, InitError>,
) -> Result<Chosen, InitError> {
    let is_open = |source: &&Source| !source.other_turns.is_empty();
    let most = sources.iter().filter(is_open);
    let most = most
        .flat_map(|s| s.other_turns.values().map(Vec::len))
        .max();
    let Some(most) = most else {
        return Ok(Chosen {
            sources: None,
            facts: Vec::new(),
        });
    };
    // `[way][body]`, the way of now first.
    let mut all = vec![residuals(model, found, before)];
    for way in 0..most {
        let read = with_ways(model, sources, |_| Some(way))?;
        all.push(residuals(model, found, &tables(&read)?));
    }
    let best = |body: usize| -> (usize, TurnsHow) {
        let rms = all.iter().map(|of| of[body]).enumerate();
        let mut rms: Vec<(usize, f64)> = rms.filter_map(|(way, rms)| Some((way, rms?))).collect();
        rms.sort_by(|a, b| a.1.total_cmp(&b.1));
        match rms[..] {
            [(way, rms), (_, next), ..] if next > CERTAIN * rms => {
                (way, TurnsHow::Motion { rms, next })
            }
            _ => (0, TurnsHow::Assumed),
        }
    };
    let mut ways: Vec<(usize, TurnsHow)> = (0..found.len()).map(best).collect();
    like_others(&mut ways);
    let place = |source: &Source, name: &str| {
        found
            .iter()
            .position(|body| source.name_in_file(&body.name) == name)
    };
    let read = with_ways(model, sources, |(source, name)| {
        ways[place(source, name)?].0.checked_sub(1)
    })?;
    let mut facts: Vec<Fact> = Vec::new();
    for source in read.iter().filter(is_open) {
        let Some(map) = &source.columns else { continue };
        for name in source.other_turns.keys() {
            let Some((body, columns)) = place(source, name).zip(map.bodies.get(name)) else {
                continue;
            };
            let Some((notation, names)) = Notation::of(columns) else {
                continue;
            };
            let fact = Fact::new(
                Place::Body(found[body].name.clone()),
                About::Turns {
                    columns: names,
                    notation,
                    unit: (notation.has_angles()).then(|| map.body_angles.unwrap_or(map.angles)),
                    how: ways[body].1,
                },
            );
            if !facts.contains(&fact) {
                facts.push(fact);
            }
        }
    }
    Ok(Chosen {
        sources: Some(read),
        facts,
    })
}

/// One tracker writes all bodies alike: where the motion shows one way and no other, bodies that stand still are read so too.
fn like_others(ways: &mut [(usize, TurnsHow)]) {
    let shown = ways.iter().filter(|(_, how)| *how != TurnsHow::Assumed);
    let mut shown: Vec<usize> = shown.map(|(way, _)| *way).collect();
    shown.dedup();
    if let [one] = shown[..] {
        let open = ways.iter_mut().filter(|(_, how)| *how == TurnsHow::Assumed);
        open.for_each(|way| *way = (one, TurnsHow::AsOthers));
    }
}

/// The files with bodies read in another way, by the body; `None`, or no such way: as now.
fn with_ways(
    model: &RobotModel,
    sources: &[Source],
    way: impl Fn((&Source, &str)) -> Option<usize>,
) -> Result<Vec<Source>, InitError> {
    let of = |source: &Source| -> Result<Source, InitError> {
        let Some(mut map) = source
            .columns
            .clone()
            .filter(|_| !source.other_turns.is_empty())
        else {
            return Ok(source.clone());
        };
        let mut other = false;
        for (name, ways) in &source.other_turns {
            let new: Option<&BodyColumns> = way((source, name)).and_then(|way| ways.get(way));
            if let (Some(new), Some(columns)) = (new, map.bodies.get_mut(name)) {
                columns.clone_from(new);
                other = true;
            }
        }
        if other {
            source.with_columns(model, map)
        } else {
            Ok(source.clone())
        }
    };
    sources.iter().map(of).collect()
}
