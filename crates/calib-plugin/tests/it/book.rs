//! The code of the book's plugin pages stands in the projects that `new_project` makes, which are built and tested.

use std::path::PathBuf;

use calib_plugin::{Kind, Language, new_project};

use crate::bed::file;

/// Lines without their indentation.
fn plain(text: &str) -> String {
    text.lines()
        .map(|line| format!("{}\n", line.trim()))
        .collect()
}

#[test]
fn the_code_of_the_book_is_the_code_of_the_templates() {
    let folder = tempfile::tempdir().unwrap();
    let source = |language: Language, path: &str| {
        let name = format!("my-sphere-{}", path.len());
        let project: PathBuf = new_project(&name, Kind::Cor, language, folder.path()).unwrap();
        let text = std::fs::read_to_string(project.join(path)).unwrap();
        plain(&text)
            .replace(&name, "my-sphere")
            .replace(&name.replace('-', "_"), "my_sphere")
    };
    let rust = source(Language::Rust, "src/lib.rs");
    let c = source(Language::C, "plugin.c");
    let page = std::fs::read_to_string(file("../../book/src/plugins/ten-minutes.md")).unwrap();
    let mut blocks = 0;
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        let source = match line.trim() {
            "```rs" => &rust,
            "```c" => &c,
            _ => continue,
        };
        let block: Vec<&str> = lines
            .by_ref()
            .take_while(|line| line.trim() != "```")
            .collect();
        let block = plain(&block.join("\n"));
        assert!(source.contains(&block), "not in the template:\n{block}");
        blocks += 1;
    }
    assert_eq!(blocks, 6);
}
