use super::*;

/// A unit cube of twelve triangles.
fn cube() -> Vec<Triangle> {
    let p = |x: i32, y: i32, z: i32| Point3::new(f64::from(x), f64::from(y), f64::from(z));
    let quads = [
        [p(0, 0, 0), p(0, 1, 0), p(1, 1, 0), p(1, 0, 0)],
        [p(0, 0, 1), p(1, 0, 1), p(1, 1, 1), p(0, 1, 1)],
        [p(0, 0, 0), p(1, 0, 0), p(1, 0, 1), p(0, 0, 1)],
        [p(0, 1, 0), p(0, 1, 1), p(1, 1, 1), p(1, 1, 0)],
        [p(0, 0, 0), p(0, 0, 1), p(0, 1, 1), p(0, 1, 0)],
        [p(1, 0, 0), p(1, 1, 0), p(1, 1, 1), p(1, 0, 1)],
    ];
    let halves = quads
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    halves.collect()
}

fn binary_stl(triangles: &[Triangle]) -> Vec<u8> {
    let mut bytes = b"solid, but binary".to_vec();
    bytes.resize(80, b' ');
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        for p in triangle {
            bytes.extend(p.iter().flat_map(|x| (*x as f32).to_le_bytes()));
        }
        bytes.extend([0; 2]);
    }
    bytes
}

fn text_stl(triangles: &[Triangle]) -> Vec<u8> {
    let vertex = |p: &Point3<f64>| format!("      vertex {} {} {}\r\n", p.x, p.y, p.z);
    let facet = |t: &Triangle| {
        let vertices: String = t.iter().map(vertex).collect();
        format!("  facet normal 0 0 0\r\n    outer loop\r\n{vertices}    endloop\r\n  endfacet\r\n")
    };
    let facets: String = triangles.iter().map(facet).collect();
    format!("solid cube\r\n{facets}endsolid\r\n").into_bytes()
}

/// The same cube with six quadrilaterals, as modelers write it.
const CUBE_OBJ: &str = "# caf\u{e9}\nmtllib missing.mtl\no cube\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
    vn 0 0 1\nusemtl red\nf 1//1 4//1 3//1 2//1\nf 5 6 7 8\nf 1 2 6 5\nf -5 -1 -2 -6\nf 1 5 8 4\nf 2 3 7 6\n";

/// A Collada file: a unit square of one polygon, put into a scene by `nodes`.
fn dae(p: &str, nodes: &str) -> String {
    format!(
        r##"<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.001" name="millimeter"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="s"><float_array id="a" count="12">0 0 0 1 0 0 1 1 0 0 1 0</float_array>
<technique_common><accessor source="#a" count="4" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#n" offset="1"/>
<vcount>4</vcount><p>{p}</p></polylist></mesh></geometry></library_geometries>
<library_nodes><node id="l"><translate>0 0 5</translate><instance_geometry url="#g"/></node></library_nodes>
<library_visual_scenes><visual_scene id="sc">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#sc"/></scene></COLLADA>"##
    )
}

const SQUARE: &str = "0 0 1 0 2 0 3 0";

fn ends(triangles: &[Triangle]) -> [[f64; 2]; 3] {
    std::array::from_fn(|k| {
        let all = || triangles.iter().flatten().map(|p| p[k]);
        [
            all().fold(f64::INFINITY, f64::min),
            all().fold(f64::NEG_INFINITY, f64::max),
        ]
    })
}

#[test]
fn a_cube_is_the_same_in_each_kind_of_file() {
    let files = [
        (MeshFormat::Stl, binary_stl(&cube())),
        (MeshFormat::Stl, text_stl(&cube())),
        (MeshFormat::Obj, CUBE_OBJ.into()),
    ];
    for (format, bytes) in files {
        let triangles = format.triangles(&bytes).expect("a mesh");
        assert_eq!(triangles.len(), 12, "{format:?}");
        assert_eq!(ends(&triangles), [[0.0, 1.0]; 3], "{format:?}");
        let area = |t: &Triangle| 0.5 * (t[1] - t[0]).cross(&(t[2] - t[0])).norm();
        let area: f64 = triangles.iter().map(area).sum();
        assert!((area - 6.0).abs() < 1e-12, "{format:?}: {area}");
    }
}

/// Millimeters become meters, a part that is used twice is there twice, and transformations apply from the inside out.
#[test]
fn parts_of_a_scene_stand_where_it_puts_them() {
    let nodes = r##"<node><translate>10 0 0</translate><rotate>0 0 1 90</rotate><scale>2 2 2</scale><instance_geometry url="#g"/></node>
        <node><matrix>1 0 0 0  0 1 0 20  0 0 1 0  0 0 0 1</matrix><node><instance_node url="#l"/></node></node>"##;
    let triangles = MeshFormat::Dae.triangles(dae(SQUARE, nodes).as_bytes());
    let triangles = triangles.expect("a mesh");
    assert_eq!(triangles.len(), 4);
    let close = |found: [[f64; 2]; 3], wanted: [[f64; 2]; 3]| {
        let (found, wanted) = (found.as_flattened(), wanted.as_flattened());
        let off = found.iter().zip(wanted).map(|(a, b)| (a - b / 1e3).abs());
        assert!(off.fold(0.0, f64::max) < 1e-12, "{found:?}");
    };
    close(ends(&triangles[..2]), [[8.0, 10.0], [0.0, 2.0], [0.0, 0.0]]);
    close(
        ends(&triangles[2..]),
        [[0.0, 1.0], [20.0, 21.0], [5.0, 5.0]],
    );
}

#[test]
fn what_is_no_mesh_is_an_error() {
    let mut cut = binary_stl(&cube());
    cut.truncate(300);
    cut[..5].copy_from_slice(b"mesh ");
    let mut not_finite = cube();
    not_finite[3][1].x = f64::NAN;
    let mut boast = vec![0; 84];
    boast[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    let put = r##"<node id="n"><instance_geometry url="#g"/></node>"##;
    let looped = r##"<node id="l2"><instance_node url="#l2"/></node>"##;
    let deep = format!(
        "{}{put}{}",
        "<node>".repeat(100_000),
        "</node>".repeat(100_000)
    );
    let table: [(MeshFormat, Vec<u8>, &str); 18] = [
        (MeshFormat::Stl, b"".into(), "at least 84"),
        (MeshFormat::Stl, b"solid x\nvertex 1 2\n".into(), "line 2"),
        (
            MeshFormat::Stl,
            b"solid x\nvertex 1 2 3\n".into(),
            "1 vertices are no triangles",
        ),
        (
            MeshFormat::Stl,
            b"solid x\nendsolid\n".into(),
            "no triangles",
        ),
        (MeshFormat::Stl, b"<html>".into(), "at least 84"),
        (MeshFormat::Stl, cut, "12 triangles need 684"),
        (MeshFormat::Stl, binary_stl(&not_finite), "triangle 4"),
        (MeshFormat::Stl, boast, "at most 2000000"),
        (MeshFormat::Obj, b"<html>".into(), "no triangles"),
        (
            MeshFormat::Obj,
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n".into(),
            "",
        ),
        (MeshFormat::Obj, b"v 0 0 x\n".into(), ""),
        (
            MeshFormat::Dae,
            b"<html/>".into(),
            "the root is not <COLLADA>",
        ),
        (MeshFormat::Dae, b"<COLLADA/>".into(), "no triangles"),
        (
            MeshFormat::Dae,
            dae("0 0 1 0 2 0 9 0", put).into(),
            "a vertex that is not there",
        ),
        (MeshFormat::Dae, dae("0 0 1 0", put).into(), "fewer corners"),
        (
            MeshFormat::Dae,
            dae("0 0 1 0 2 0 -1 0", put).into(),
            "no number in `-1`",
        ),
        (
            MeshFormat::Dae,
            dae(SQUARE, looped).into(),
            "use themselves",
        ),
        (
            MeshFormat::Dae,
            dae(SQUARE, &deep).into(),
            "nested in more than 1000",
        ),
    ];
    for (format, bytes, part) in table {
        let error = format.triangles(&bytes).expect_err(part).to_string();
        assert!(error.contains(part), "{format:?}: {error}");
    }
}

/// A damaged file is an error or a mesh, never a panic: every cut and many changed bytes of a file of each kind.
#[test]
fn damaged_files_do_not_end_the_program() {
    let nodes = r##"<node><rotate>0 0 1 90</rotate><instance_geometry url="#g"/></node>"##;
    let files = [
        (MeshFormat::Stl, text_stl(&cube()[..2])),
        (MeshFormat::Obj, CUBE_OBJ.into()),
        (MeshFormat::Dae, dae(SQUARE, nodes).into()),
    ];
    for (format, bytes) in files {
        for i in 0..bytes.len() {
            let _ = format.triangles(&bytes[..i]);
            for other in *b"0-9 </\xff" {
                let mut changed = bytes.clone();
                changed[i] = other;
                let _ = format.triangles(&changed);
            }
        }
    }
}
