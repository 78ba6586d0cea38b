//! Where plugins in C are built for a test.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use calib_plugin::{BodyPose, Host, LoadedPlugin, MotionData, PluginError, SearchPath};

/// Runs a compiler; `None`, with a message, where there is none.
pub fn compiler(program: &str, arguments: &[&str]) -> Option<()> {
    let output = match Command::new(program).args(arguments).output() {
        Ok(output) => output,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            skipped_tests::skip(&format!("no compiler `{program}`"));
            return None;
        }
        Err(error) => panic!("{program}: {error}"),
    };
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success(),
        "{program} {arguments:?}\n{messages}"
    );
    Some(())
}

/// The folder with the header.
pub fn include() -> String {
    format!("-I{}/include", env!("CARGO_MANIFEST_DIR"))
}

/// A file of this crate.
pub fn file(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// A folder with built plugins.
pub struct Bed(tempfile::TempDir);

impl Bed {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// Builds `source` (relative to this crate) as a shared library called `name`.
    pub fn build(&self, source: &str, name: &str, defines: &[&str]) -> Option<PathBuf> {
        let library = self.path().join(format!(
            "{}{name}{}",
            std::env::consts::DLL_PREFIX,
            std::env::consts::DLL_SUFFIX
        ));
        let (source, include) = (file(source), include());
        let cpp = source.extension().is_some_and(|e| e == "cc");
        let standard = if cpp { "-std=c++17" } else { "-std=c11" };
        let defines: Vec<String> = defines.iter().map(|d| format!("-D{d}")).collect();
        let (from, to) = (source.to_str()?, library.to_str()?);
        let mut arguments = vec![
            standard, "-Wall", "-Wextra", "-Werror", "-O1", "-shared", "-fPIC", &include,
        ];
        arguments.extend(defines.iter().map(String::as_str));
        arguments.extend([from, "-o", to, "-lm"]);
        compiler(if cpp { "c++" } else { "cc" }, &arguments)?;
        Some(library)
    }

    /// Loads a library from this folder by name.
    pub fn load(&self, name: &str) -> Result<LoadedPlugin, PluginError> {
        let search = SearchPath {
            environment: vec![self.path().to_path_buf()],
            ..SearchPath::default()
        };
        Host::new(search, true).load(name, None)
    }

    /// A message without this folder's path, the platform's ending of libraries, and the loader's own words.
    pub fn tidy(&self, message: &impl ToString) -> String {
        let text = message
            .to_string()
            .replace(&self.path().display().to_string(), "[bed]")
            .replace(std::env::consts::DLL_SUFFIX, ".so");
        match text.find("dlsym failed") {
            Some(at) => format!("{}[the loader's words]", &text[..at]),
            None => text,
        }
    }
}

/// The corners of a cube around (1, 2, 3), one marker; the second marker on a smaller cube, one sample lost.
pub fn cubes() -> MotionData {
    let cube = |half: f64| -> Vec<Option<[f64; 3]>> {
        (0..8_u32)
            .map(|i| {
                let side = |bit: u32| if i >> bit & 1 == 0 { -half } else { half };
                Some([1.0 + side(0), 2.0 + side(1), 3.0 + side(2)])
            })
            .collect()
    };
    let mut second = cube(0.05);
    second[3] = None;
    MotionData::points(&[cube(0.1), second])
}

/// Poses turning about z by 0.3 rad each.
pub fn turning() -> Vec<Option<BodyPose>> {
    (0..6)
        .map(|i| {
            let (s, c) = (0.3 * f64::from(i)).sin_cos();
            Some(BodyPose {
                rotation: [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
                translation_m: [c, s, 0.5],
            })
        })
        .collect()
}
