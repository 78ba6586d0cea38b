//! A glTF file that is being made: meshes, nodes and motions, and their numbers in one buffer.

use gltf_json as json;
use json::accessor::{Accessor, ComponentType, GenericComponentType, Type};
use json::animation::{Animation, Channel, Interpolation, Property, Sampler, Target};
use json::buffer::{Buffer, Target as Binding, View};
use json::extensions::material::{Material as Extension, Unlit};
use json::material::{Material, PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use json::mesh::{Mesh, Mode, Primitive, Semantic};
use json::scene::{Node, Scene as GltfScene};
use json::validation::Checked::Valid;
use json::{Asset, Index, Root};

use crate::ReportError;

/// Colors of [`Color`], linear RGB.
const COLORS: [(&str, [f32; 3]); 7] = [
    ("calibrated", [0.0, 0.168, 0.445]),
    ("nominal", [0.565, 0.109, 0.0]),
    ("marker", [0.271, 0.040, 0.235]),
    ("error", [0.527, 0.0, 0.0]),
    ("joint", [0.0, 0.216, 0.107]),
    ("soft", [0.168, 0.168, 0.168]),
    ("body", [0.584, 0.646, 0.701]),
];

/// What a mesh is drawn in.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Color {
    Calibrated,
    Nominal,
    Marker,
    Error,
    Joint,
    Soft,
    /// The only one that has light and shadow.
    Body,
}

impl Color {
    pub(super) fn name(self) -> &'static str {
        COLORS[self as usize].0
    }
}

/// A glTF file that is being made.
#[derive(Default)]
pub(super) struct File {
    pub(super) root: Root,
    bytes: Vec<u8>,
    channels: Vec<Channel>,
    samplers: Vec<Sampler>,
    /// The accessor of the poses' times.
    times: Option<Index<Accessor>>,
}

/// A node of a name.
pub(super) fn named(name: impl Into<String>) -> Node {
    Node {
        name: Some(name.into()),
        ..Node::default()
    }
}

impl File {
    pub(super) fn node(&mut self, node: Node) -> Index<Node> {
        self.root.push(node)
    }

    fn buffer_view(&mut self, bytes: &[u8], target: Option<Binding>) -> Index<View> {
        // Accessors of floats begin at multiples of four.
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = View {
            buffer: Index::new(0),
            byte_length: bytes.len().into(),
            byte_offset: Some(self.bytes.len().into()),
            byte_stride: None,
            name: None,
            target: target.map(Valid),
            extensions: None,
            extras: None,
        };
        self.bytes.extend_from_slice(bytes);
        self.root.push(view)
    }

    /// Floats in rows of N, with the smallest and largest of each column, which positions and times must have.
    fn floats<const N: usize>(
        &mut self,
        rows: &[[f64; N]],
        kind: Type,
        binding: Option<Binding>,
    ) -> Index<Accessor> {
        let rows: Vec<[f32; N]> = rows.iter().map(|row| row.map(narrow)).collect();
        let numbers = rows.iter().flatten();
        let bytes: Vec<u8> = numbers.flat_map(|x| x.to_le_bytes()).collect();
        let view = self.buffer_view(&bytes, binding);
        let over = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            let column = |k: usize| rows.iter().map(|row| row[k]).reduce(pick);
            (0..N).map(|k| column(k).unwrap_or(0.0)).collect()
        };
        let (min, max) = (over(f32::min), over(f32::max));
        self.accessor(
            view,
            rows.len(),
            (ComponentType::F32, kind),
            Some([min, max]),
        )
    }

    fn accessor(
        &mut self,
        view: Index<View>,
        count: usize,
        (component, kind): (ComponentType, Type),
        ends: Option<[Vec<f32>; 2]>,
    ) -> Index<Accessor> {
        let [min, max] = ends.map_or([None, None], |ends| ends.map(|e| Some(e.into())));
        self.root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: count.into(),
            component_type: Valid(GenericComponentType(component)),
            type_: Valid(kind),
            min,
            max,
            name: None,
            normalized: false,
            sparse: None,
            extensions: None,
            extras: None,
        })
    }

    pub(super) fn primitive(&mut self, mode: Mode, color: Color, points: &[[f64; 3]]) -> Primitive {
        let positions = self.floats(points, Type::Vec3, Some(Binding::ArrayBuffer));
        Primitive {
            attributes: [(Valid(Semantic::Positions), positions)].into(),
            mode: Valid(mode),
            material: Some(Index::new(color as u32)),
            indices: None,
            targets: None,
            extensions: None,
            extras: None,
        }
    }

    /// Corners of triangles by their index among the points of a primitive.
    pub(super) fn indices(&mut self, corners: &[u16]) -> Index<Accessor> {
        let bytes: Vec<u8> = corners.iter().flat_map(|i| i.to_le_bytes()).collect();
        let view = self.buffer_view(&bytes, Some(Binding::ElementArrayBuffer));
        let kind = (ComponentType::U16, Type::Scalar);
        self.accessor(view, corners.len(), kind, None)
    }

    pub(super) fn mesh_of(&mut self, name: &str, primitives: Vec<Primitive>) -> Index<Mesh> {
        self.root.push(Mesh {
            name: Some(name.to_owned()),
            primitives,
            weights: None,
            extensions: None,
            extras: None,
        })
    }

    /// `None` where there is nothing to draw: an accessor must not be empty.
    pub(super) fn mesh(
        &mut self,
        name: &str,
        mode: Mode,
        color: Color,
        points: &[[f64; 3]],
    ) -> Option<Index<Mesh>> {
        if points.is_empty() {
            return None;
        }
        let primitive = self.primitive(mode, color, points);
        Some(self.mesh_of(name, vec![primitive]))
    }

    /// One value a pose: the node jumps from one to the next.
    pub(super) fn animate<const N: usize>(
        &mut self,
        node: Index<Node>,
        path: Property,
        values: &[[f64; N]],
    ) {
        // What does not move needs no motion.
        if values.windows(2).all(|pair| pair[0] == pair[1]) {
            return;
        }
        let times = match self.times {
            Some(times) => times,
            None => {
                let seconds: Vec<[f64; 1]> = (0..values.len()).map(|i| [i as f64]).collect();
                let times = self.floats(&seconds, Type::Scalar, None);
                self.times = Some(times);
                times
            }
        };
        let kind = if N == 4 { Type::Vec4 } else { Type::Vec3 };
        let output = self.floats(values, kind, None);
        let sampler = Sampler {
            input: times,
            output,
            interpolation: Valid(Interpolation::Step),
            extensions: None,
            extras: None,
        };
        let sampler = Index::push(&mut self.samplers, sampler);
        self.channels.push(Channel {
            sampler,
            target: Target {
                node,
                path: Valid(path),
                extensions: None,
                extras: None,
            },
            extensions: None,
            extras: None,
        });
    }

    /// JSON and binary chunk behind the twelve bytes of the header (§4.4 of the specification). `about` goes into the
    /// scene's extras.
    pub(super) fn finish(
        mut self,
        (name, generator): (&str, String),
        about: &serde_json::Value,
        top: Index<Node>,
    ) -> Result<Vec<u8>, ReportError> {
        let failed = |e: serde_json::Error| ReportError::Json(e.to_string());
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.root.asset = Asset {
            generator: Some(generator),
            ..Asset::default()
        };
        self.root.extensions_used = vec!["KHR_materials_unlit".to_owned()];
        self.root.materials = COLORS.iter().map(material).collect();
        self.root.buffers = vec![Buffer {
            byte_length: self.bytes.len().into(),
            name: None,
            uri: None,
            extensions: None,
            extras: None,
        }];
        self.root.scene = Some(Index::new(0));
        self.root.scenes = vec![GltfScene {
            name: Some(name.to_owned()),
            nodes: vec![top],
            extensions: None,
            extras: Some(serde_json::value::to_raw_value(about).map_err(failed)?),
        }];
        if !self.channels.is_empty() {
            self.root.animations = vec![Animation {
                name: Some("poses".to_owned()),
                channels: self.channels,
                samplers: self.samplers,
                extensions: None,
                extras: None,
            }];
        }
        let mut text = self.root.to_vec().map_err(failed)?;
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + text.len() + 8 + self.bytes.len();
        let length = |n: usize| {
            u32::try_from(n)
                .map(u32::to_le_bytes)
                .map_err(|_| ReportError::Json(format!("a glTF file of {total} bytes is too long")))
        };
        let mut out = Vec::with_capacity(total);
        out.extend_from_slice(b"glTF");
        out.extend_from_slice(&2u32.to_le_bytes());
        out.extend_from_slice(&length(total)?);
        out.extend_from_slice(&length(text.len())?);
        out.extend_from_slice(b"JSON");
        out.extend_from_slice(&text);
        out.extend_from_slice(&length(self.bytes.len())?);
        out.extend_from_slice(b"BIN\0");
        out.extend_from_slice(&self.bytes);
        Ok(out)
    }
}

/// A color, of lines and marks without light and shadow.
fn material((name, [r, g, b]): &(&str, [f32; 3])) -> Material {
    let is_body = *name == Color::Body.name();
    Material {
        name: Some((*name).to_owned()),
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor([*r, *g, *b, 1.0]),
            metallic_factor: StrengthFactor(0.0),
            ..PbrMetallicRoughness::default()
        },
        extensions: (!is_body).then_some(Extension {
            unlit: Some(Unlit {}),
        }),
        // Meshes from elsewhere do not always look outwards.
        double_sided: is_body,
        ..Material::default()
    }
}

/// What no 32-bit number holds becomes the largest that there is.
pub(super) fn narrow(x: f64) -> f32 {
    x.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
}
