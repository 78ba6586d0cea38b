//! New links on fixed joints, and the comment above `<robot>`.

use super::patcher::Patcher;
use crate::edit::change::UrdfEdit;
use crate::edit::error::EditError;
use crate::edit::insert::{self, FixedFrame};
use crate::model::UnknownName;
use crate::read::source::OwnAttributes as _;
use crate::read::source::{child, top_level};
use roxmltree::Node;

impl Patcher<'_, '_> {
    /// Adds a link on a fixed joint, or moves it where the text has both already; `edits` may add its parent.
    pub(super) fn add_frame(
        &mut self,
        frame: &FixedFrame<'_>,
        edits: &[UrdfEdit],
    ) -> Result<(), EditError> {
        insert::check_name("link", frame.link)?;
        insert::check_name("joint", frame.joint)?;
        let named = |kind, name| {
            top_level(self.context.document, kind).find(move |node| node.own("name") == Some(name))
        };
        match (named("link", frame.link), named("joint", frame.joint)) {
            (None, None) => {}
            (Some(_), Some(node)) if is_frame(node, frame) => {
                return self.set_origin(frame.joint, frame.parent_from_frame);
            }
            (Some(_), _) => return Err(self.name_taken("link", frame.link)),
            (None, Some(_)) => return Err(self.name_taken("joint", frame.joint)),
        }
        self.check_parent(frame.parent_link, edits)?;
        let (text, document) = (self.context.text, self.context.document);
        let element = insert::Style::of(text, document).fixed_frame(frame);
        let shown = element.trim().to_owned();
        let at = insert::before_closing_tag(text, document);
        self.insert((at, element), frame.joint, "<link>".to_owned(), shown);
        Ok(())
    }

    fn name_taken(&self, kind: &'static str, name: &str) -> EditError {
        EditError::NameTaken {
            file: self.file.to_owned(),
            kind,
            name: name.to_owned(),
        }
    }

    /// The parent of a new frame has to be a link of the text, or one that another edit adds.
    fn check_parent(&self, parent_link: &str, edits: &[UrdfEdit]) -> Result<(), EditError> {
        let document = self.context.document;
        let added = edits.iter().filter_map(|edit| match edit {
            UrdfEdit::AddFixedFrame { name, .. } => Some(name.as_str()),
            _ => None,
        });
        let known: Vec<&str> = top_level(document, "link")
            .filter_map(|node| node.own("name"))
            .chain(added)
            .collect();
        // A xacro may get its links from elsewhere.
        if self.is_xacro || known.contains(&parent_link) {
            return Ok(());
        }
        let robot = document.root_element().own("name").unwrap_or("");
        let source = UnknownName::among(robot, "link", parent_link, known);
        Err(EditError::UnknownName {
            file: self.file.to_owned(),
            source,
        })
    }

    /// Adds a comment above `<robot>`, once.
    pub(super) fn add_provenance(&mut self, words: &str) {
        let (text, document) = (self.context.text, self.context.document);
        let style = insert::Style::of(text, document);
        let comment = insert::comment(words, style.line_ending);
        if document
            .descendants()
            .any(|node| node.is_comment() && text[node.range()] == comment)
        {
            return;
        }
        let at = document.root_element().range().start;
        let line = format!("{comment}{}", style.line_ending);
        self.insert((at, line), "", "<!-- -->".to_owned(), comment);
    }
}

/// Is this the fixed joint of the frame, as an earlier patch wrote it?
fn is_frame(joint: Node<'_, '_>, frame: &FixedFrame<'_>) -> bool {
    let end = |element| child(joint, element).and_then(|end| end.own("link"));
    joint.own("type") == Some("fixed")
        && end("parent") == Some(frame.parent_link)
        && end("child") == Some(frame.link)
}
