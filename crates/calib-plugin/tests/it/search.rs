//! Where plugins are found, pins, and what cannot be loaded.

use std::path::PathBuf;

use calib_plugin::{Host, PluginError, SearchPath};

use crate::bed::Bed;

fn file_name(name: &str) -> String {
    format!(
        "{}{name}{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    )
}

#[test]
fn names_are_sought_beside_the_profile_then_in_the_variable_then_in_the_installation() {
    let root = tempfile::tempdir().unwrap();
    let folder = |name: &str| root.path().join(name);
    let put = |place: &str, name: &str| -> PathBuf {
        std::fs::create_dir_all(folder(place)).unwrap();
        let path = folder(place).join(file_name(name));
        std::fs::write(&path, place).unwrap();
        path
    };
    let search = SearchPath {
        profile: Some(folder("robots")),
        environment: vec![folder("one"), folder("two")],
        installation: Some(folder("lib")),
    };
    let missing = search.find("my-plugin").unwrap_err();
    let looked = missing
        .to_string()
        .replace(&root.path().display().to_string(), "");
    if cfg!(target_os = "linux") {
        insta::assert_snapshot!(looked.replace(", ", ",\n"));
    }
    assert_eq!(missing.exit_code(), 6);

    // Each of these stands before those found so far.
    for (place, name) in [
        ("lib", "my_plugin"),
        ("two", "my-plugin"),
        ("one", "my_plugin"),
        ("robots/plugins", "my-plugin"),
    ] {
        let path = put(place, name);
        assert_eq!(search.find("my-plugin").unwrap(), path, "{place}");
    }
    put("two", "other");
    let names: Vec<_> = search
        .discover()
        .into_iter()
        .map(|found| found.name)
        .collect();
    assert_eq!(names, ["my-plugin", "my_plugin", "other"]);
    let near = search.find("oter").unwrap_err().to_string();
    assert!(
        near.ends_with("; there are `my-plugin`, `my_plugin`, `other`"),
        "{near}"
    );

    // Paths are relative to the profile; a folder is not a library.
    let by_path = search
        .find(&format!("plugins/{}", file_name("my-plugin")))
        .unwrap();
    assert_eq!(std::fs::read_to_string(by_path).unwrap(), "robots/plugins");
    assert!(search.find("plugins/").is_err());
}

#[test]
fn what_is_no_library_is_refused_with_the_loader_s_own_words() {
    let root = tempfile::tempdir().unwrap();
    let path = root.path().join(file_name("text"));
    std::fs::write(&path, "not a library").unwrap();
    let host = Host::new(SearchPath::default(), true);
    let error = host.load(path.to_str().unwrap(), None).unwrap_err();
    let PluginError::Open { reason, .. } = &error else {
        panic!("{error}")
    };
    // The loader's reason, not only "dlopen failed".
    assert!(reason.contains(": "), "{reason}");
    assert_eq!(error.exit_code(), 6);
}

#[test]
fn nothing_is_loaded_when_plugins_are_off() {
    let error = Host::new(SearchPath::default(), false)
        .load("x", None)
        .unwrap_err();
    assert_eq!(
        error.to_string(),
        "plugin `x` is needed, but plugins are switched off (--no-plugins or CALIB_NO_PLUGINS)"
    );
}

#[test]
fn a_pin_is_compared_before_the_library_is_opened() {
    let root = tempfile::tempdir().unwrap();
    let path = root.path().join(file_name("pinned"));
    // FIPS 180-2, appendix B.1: the hash of `abc`.
    std::fs::write(&path, "abc").unwrap();
    let pin = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
    let host = Host::new(
        SearchPath {
            environment: vec![root.path().into()],
            ..SearchPath::default()
        },
        true,
    );
    let said = |pin: &str| host.load("pinned", Some(pin)).unwrap_err();
    // Right: the next thing that is wrong is that it is no library.
    assert!(matches!(said(pin), PluginError::Open { .. }));
    assert!(matches!(
        said(&format!("sha256:{}", pin.to_uppercase())),
        PluginError::Open { .. }
    ));
    let PluginError::Pin { found, needed, .. } = said(&pin.replace('b', "c")) else {
        panic!()
    };
    assert_eq!((found.as_str(), needed), (pin, pin.replace('b', "c")));
    assert_eq!(
        said("sha256:12").to_string(),
        "plugin `pinned`: `sha256:12` is not a SHA-256 (64 hexadecimal digits)"
    );
}

#[test]
fn a_pinned_plugin_loads() {
    let bed = Bed::new();
    let Some(path) = bed.build("tests/c/cor.c", "good", &[]) else {
        return;
    };
    let host = Host::new(SearchPath::default(), true);
    let wrong = "0".repeat(64);
    let PluginError::Pin { found, .. } =
        host.load(path.to_str().unwrap(), Some(&wrong)).unwrap_err()
    else {
        panic!("a wrong pin")
    };
    let plugin = host.load(path.to_str().unwrap(), Some(&found)).unwrap();
    assert_eq!(plugin.description.name, "bad");
}
