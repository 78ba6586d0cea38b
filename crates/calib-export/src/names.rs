//! Names of links that another format does not take: each has its own reserved words.

use std::collections::BTreeSet;

use calib_model::file::RobotModelFile;

use crate::target::Target;

/// The robot with names that a format takes, and a note of each that was changed.
///
/// - MJCF: `world` is the body that everything is in.
/// - SDF: `world` likewise; names between double underscores are SDF's own, `::` separates the names of a path, and a link and a joint of a model
///   share no name (SDF 1.7, `Non-unique name detected`).
pub(crate) fn accepted(mut file: RobotModelFile, target: Target) -> (RobotModelFile, Vec<String>) {
    let joints: BTreeSet<String> = file.joints.iter().map(|j| j.name.clone()).collect();
    let children = file.joints.iter().map(|j| j.child.clone());
    let links: Vec<String> = std::iter::once(file.root.clone()).chain(children).collect();
    let mut taken: BTreeSet<String> = links.iter().chain(&joints).cloned().collect();
    let mut notes = Vec::new();
    for old in links {
        let refused = match target {
            Target::Mjcf => old == "world",
            Target::Sdf => is_of_sdf(&old) || joints.contains(&old),
            _ => false,
        };
        if !refused {
            continue;
        }
        let mut new = format!("{}_link", old.replace("::", "_").trim_matches('_'));
        while !taken.insert(new.clone()) {
            new.push('_');
        }
        notes.push(format!(
            "Link `{old}` is `{new}` here: {} does not take its name for a link of this robot.",
            target.name().to_uppercase()
        ));
        rename(&mut file, &old, &new);
    }
    (file, notes)
}

fn is_of_sdf(name: &str) -> bool {
    name == "world" || name.contains("::") || name.starts_with("__") && name.ends_with("__")
}

fn rename(file: &mut RobotModelFile, old: &str, new: &str) {
    let ends = file.joints.iter_mut();
    let ends = ends.flat_map(|j| [&mut j.parent, &mut j.child]);
    let links = file.links.iter_mut().map(|link| &mut link.name);
    let names = ends.chain(links).chain([&mut file.root]);
    names.filter(|name| **name == old).for_each(|name| {
        new.clone_into(name);
    });
}
