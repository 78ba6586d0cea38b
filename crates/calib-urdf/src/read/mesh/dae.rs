//! Collada 1.4 and 1.5: the geometries where the scene puts them, in m. As in RViz, z is up whatever the file says.
//!
//! Barnes, Finch, COLLADA – Digital Asset Schema Release 1.4.1, Khronos, 2008.

use super::{MeshError, TRIANGLES, Triangle, fan, moved, too_many};
use crate::read::nesting;
use nalgebra::{Matrix4, Point3, Rotation3, Unit, Vector3};
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::BTreeMap;

/// Nodes in nodes, and uses of nodes: more are nodes that use each other in a circle.
const LEVELS: usize = 200;
const USES: usize = 10_000;

type Found<'a, 'b> = BTreeMap<&'a str, Node<'a, 'b>>;

pub(super) fn read(dae: &[u8]) -> Result<Vec<Triangle>, MeshError> {
    let text = String::from_utf8_lossy(dae);
    nesting::check(&text).map_err(|(_, problem)| MeshError(problem.to_string()))?;
    let options = ParsingOptions {
        nodes_limit: 10_000_000,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(&text, options)
        .map_err(|error| MeshError(error.to_string()))?;
    let root = document.root_element();
    if root.tag_name().name() != "COLLADA" {
        return Err(wrong("the root is not <COLLADA>"));
    }
    let all = root
        .descendants()
        .filter_map(|n| Some((n.attribute("id")?, n)));
    let ids: Found<'_, '_> = all.collect();
    let mut reader = Reader {
        ids: &ids,
        geometries: BTreeMap::new(),
        triangles: Vec::new(),
        uses: 0,
    };
    let unit = descend(root, &["asset", "unit"]).and_then(|unit| unit.attribute("meter"));
    let unit = unit.map_or(Ok(1.0), str::parse);
    let unit: f64 = unit.map_err(|_| wrong("<unit> has no number"))?;
    let scale = Matrix4::new_scaling(unit);
    let used = descend(root, &["scene", "instance_visual_scene"]);
    match used.and_then(|used| reader.target(used)) {
        Some(scene) => reader.children(scene, &scale, 0)?,
        // A library without a scene.
        None => {
            for geometry in root
                .descendants()
                .filter(|n| n.has_tag_name(of(root, "geometry")))
            {
                reader.put(geometry, &scale)?;
            }
        }
    }
    Ok(reader.triangles)
}

struct Reader<'r, 'a, 'b> {
    ids: &'r Found<'a, 'b>,
    /// Triangles in the geometry's own frame, by the place of its element: a part may be used twice.
    geometries: BTreeMap<usize, Vec<Triangle>>,
    triangles: Vec<Triangle>,
    uses: usize,
}

impl<'a, 'b> Reader<'_, 'a, 'b> {
    /// What `url="#id"` or `source="#id"` names.
    fn target(&self, node: Node<'a, 'b>) -> Option<Node<'a, 'b>> {
        let url = node.attribute("url").or_else(|| node.attribute("source"))?;
        self.ids.get(url.strip_prefix('#')?).copied()
    }

    /// The nodes and geometries inside a node or a scene.
    fn children(
        &mut self,
        node: Node<'a, 'b>,
        world: &Matrix4<f64>,
        level: usize,
    ) -> Result<(), MeshError> {
        self.uses += 1;
        if level > LEVELS || self.uses > USES {
            return Err(wrong("too many nodes, or nodes that use themselves"));
        }
        for child in elements(node) {
            match child.tag_name().name() {
                "node" => self.children(child, &(world * transform(child)?), level + 1)?,
                "instance_node" => {
                    if let Some(node) = self.target(child) {
                        self.children(node, &(world * transform(node)?), level + 1)?;
                    }
                }
                "instance_geometry" => {
                    if let Some(geometry) = self.target(child) {
                        self.put(geometry, world)?;
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// A geometry at its place.
    fn put(&mut self, geometry: Node<'a, 'b>, world: &Matrix4<f64>) -> Result<(), MeshError> {
        let key = geometry.range().start;
        if !self.geometries.contains_key(&key) {
            let triangles = self.geometry(geometry)?;
            self.geometries.insert(key, triangles);
        }
        let known = &self.geometries[&key];
        if self.triangles.len() + known.len() > TRIANGLES {
            return Err(too_many(self.triangles.len() + known.len()));
        }
        self.triangles.extend(moved(known, world));
        Ok(())
    }

    fn geometry(&self, geometry: Node<'a, 'b>) -> Result<Vec<Triangle>, MeshError> {
        let mut triangles = Vec::new();
        // Splines are not drawn.
        let Some(mesh) = descend(geometry, &["mesh"]) else {
            return Ok(triangles);
        };
        for faces in elements(mesh) {
            let kind = faces.tag_name().name();
            if ["triangles", "polylist", "polygons", "tristrips", "trifans"].contains(&kind) {
                self.faces(faces, &mut triangles)?;
            }
        }
        Ok(triangles)
    }

    /// The polygons of one `<triangles>`, `<polylist>`, `<polygons>`, `<tristrips>` or `<trifans>`.
    fn faces(&self, faces: Node<'a, 'b>, triangles: &mut Vec<Triangle>) -> Result<(), MeshError> {
        let inputs = || elements(faces).filter(|n| n.tag_name().name() == "input");
        let offset = |input: Node<'_, '_>| -> usize {
            let offset = input.attribute("offset").and_then(|o| o.parse().ok());
            offset.unwrap_or(0)
        };
        // Each corner is one index per input.
        let stride = inputs().map(offset).max().unwrap_or(0).saturating_add(1);
        let vertex = inputs().find(|input| input.attribute("semantic") == Some("VERTEX"));
        let vertex = vertex.ok_or_else(|| wrong("faces without <input semantic=\"VERTEX\">"))?;
        let places = self.places(vertex)?;
        let kind = faces.tag_name().name();
        let counts = descend(faces, &["vcount"]);
        let counts: Vec<usize> = counts.map_or(Ok(Vec::new()), numbers)?;
        for indices in elements(faces).filter(|n| n.tag_name().name() == "p") {
            let indices: Vec<usize> = numbers(indices)?;
            let corner = |corner: &[usize]| {
                let place = corner.get(offset(vertex)).and_then(|i| places.get(*i));
                place
                    .copied()
                    .ok_or_else(|| wrong("a face names a vertex that is not there"))
            };
            let corners = indices.chunks(stride).map(corner);
            let corners = corners.collect::<Result<Vec<Point3<f64>>, _>>()?;
            match kind {
                "triangles" => triangles.extend(corners.as_chunks::<3>().0),
                "tristrips" => {
                    let turned = |(i, t): (usize, &[Point3<f64>])| {
                        if i % 2 == 0 {
                            [t[0], t[1], t[2]]
                        } else {
                            [t[1], t[0], t[2]]
                        }
                    };
                    triangles.extend(corners.windows(3).enumerate().map(turned));
                }
                "polylist" => {
                    let mut rest = &corners[..];
                    for count in &counts {
                        let polygon = rest.split_at_checked(*count);
                        let polygon =
                            polygon.ok_or_else(|| wrong("fewer corners than <vcount>"))?;
                        fan(polygon.0, triangles);
                        rest = polygon.1;
                    }
                }
                _ => fan(&corners, triangles),
            }
            if triangles.len() > TRIANGLES {
                return Err(too_many(triangles.len()));
            }
        }
        Ok(())
    }

    /// The places that `<input semantic="VERTEX" source="#vertices">` leads to.
    fn places(&self, vertex: Node<'a, 'b>) -> Result<Vec<Point3<f64>>, MeshError> {
        let is_position = |input: &Node<'_, '_>| input.attribute("semantic") == Some("POSITION");
        let source = self.target(vertex).and_then(|vertices| {
            let position = elements(vertices).find(is_position)?;
            self.target(position)
        });
        let source = source.ok_or_else(|| wrong("vertices without a source of positions"))?;
        let array = descend(source, &["float_array"]);
        let array = array.ok_or_else(|| wrong("a source without <float_array>"))?;
        let accessor = descend(source, &["technique_common", "accessor"]);
        let stride = accessor.and_then(|a| a.attribute("stride")?.parse().ok());
        let all: Vec<f64> = numbers(array)?;
        let rows = all.chunks(stride.unwrap_or(3).max(3));
        let rows = rows.filter_map(|row| row.first_chunk::<3>());
        Ok(rows.map(|row| Point3::from(*row)).collect())
    }
}

/// parent_from_node: the product of the node's transformations in the order of the file.
fn transform(node: Node<'_, '_>) -> Result<Matrix4<f64>, MeshError> {
    let mut product = Matrix4::identity();
    for child in elements(node) {
        let name = child.tag_name().name();
        if !["matrix", "translate", "rotate", "scale"].contains(&name) {
            continue;
        }
        let row: Vec<f64> = numbers(child)?;
        product *= match (name, &row[..]) {
            ("matrix", all @ [_, ..]) if all.len() == 16 => Matrix4::from_row_slice(all),
            ("translate", [x, y, z]) => Matrix4::new_translation(&Vector3::new(*x, *y, *z)),
            ("scale", [x, y, z]) => Matrix4::new_nonuniform_scaling(&Vector3::new(*x, *y, *z)),
            ("rotate", [x, y, z, degrees]) => {
                let axis = Unit::try_new(Vector3::new(*x, *y, *z), 0.0);
                let axis = axis.ok_or_else(|| wrong("<rotate> around no axis"))?;
                Rotation3::from_axis_angle(&axis, degrees.to_radians()).to_homogeneous()
            }
            _ => return Err(MeshError(format!("<{name}> has {} numbers", row.len()))),
        };
    }
    Ok(product)
}

fn numbers<T: std::str::FromStr>(node: Node<'_, '_>) -> Result<Vec<T>, MeshError> {
    let words = node.text().unwrap_or_default().split_ascii_whitespace();
    let number = |word: &str| {
        let name = node.tag_name().name();
        word.parse()
            .map_err(|_| MeshError(format!("<{name}> has no number in `{word}`")))
    };
    words.map(number).collect()
}

fn elements<'a, 'b>(node: Node<'a, 'b>) -> impl Iterator<Item = Node<'a, 'b>> {
    node.children().filter(Node::is_element)
}

/// The first element below a path of names, in any namespace.
fn descend<'a, 'b>(node: Node<'a, 'b>, path: &[&str]) -> Option<Node<'a, 'b>> {
    path.iter().try_fold(node, |node, name| {
        elements(node).find(|child| child.tag_name().name() == *name)
    })
}

/// A name in the namespace of the root.
fn of<'a>(root: Node<'a, '_>, name: &'a str) -> roxmltree::ExpandedName<'a, 'a> {
    match root.tag_name().namespace() {
        Some(space) => (space, name).into(),
        None => name.into(),
    }
}

fn wrong(text: &str) -> MeshError {
    MeshError(text.to_owned())
}
