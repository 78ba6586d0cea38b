//! What `calib plugins` prints: everything that can be named, as text and for machines.

use std::fmt;

use serde_json::json;

use crate::{
    offer::{Kind, Offer},
    parameters::schema,
    registry::{Origin, Tables},
};

impl fmt::Display for Tables {
    /// One block for each kind, one line for each name; parameters below it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = self.list();
        let width = list
            .iter()
            .map(|(offer, _)| offer.name.chars().count())
            .max()
            .unwrap_or(0);
        for kind in Kind::ALL {
            let of_kind: Vec<_> = list
                .iter()
                .filter(|(offer, _)| offer.kind == kind)
                .collect();
            if of_kind.is_empty() {
                continue;
            }
            writeln!(f, "{} ({}s)", kind.id(), kind.word())?;
            for (offer, origin) in of_kind {
                write!(f, "  {:width$}  {}", offer.name, offer.summary)?;
                match origin {
                    Origin::BuiltIn => writeln!(f)?,
                    Origin::Plugin { .. } => writeln!(f, " ({origin})")?,
                }
                for parameter in &offer.parameters {
                    let rule = if parameter.required {
                        "required, e.g."
                    } else {
                        "default"
                    };
                    writeln!(
                        f,
                        "  {:width$}    {}: {} ({rule} {})",
                        "", parameter.name, parameter.summary, parameter.value
                    )?;
                }
            }
        }
        Ok(())
    }
}

impl Tables {
    /// The same for machines: an array of objects with `kind`, `name`, `summary`, `source`, `takes`, `plugin` (null for
    /// built-ins), `version`, and `parameters` as a JSON Schema. No path, so that it is the same on every machine.
    #[must_use]
    pub fn json(&self) -> serde_json::Value {
        let one = |(offer, origin): (&Offer, &Origin)| {
            let (plugin, version) = match origin {
                Origin::BuiltIn => (None, None),
                Origin::Plugin {
                    plugin, version, ..
                } => (Some(plugin), Some(version)),
            };
            json!({
                "kind": offer.kind.id(),
                "name": offer.name,
                "summary": offer.summary,
                "source": offer.source,
                "takes": offer.shapes.iter().map(|shape| shape.word()).collect::<Vec<_>>(),
                "plugin": plugin,
                "version": version,
                "parameters": schema(&offer.parameters),
            })
        };
        self.list().into_iter().map(one).collect()
    }
}
