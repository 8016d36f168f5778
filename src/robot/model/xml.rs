//! XML of strangers: bounded in size, elements and depth before anything is made of it.

use super::shown;
use crate::error::{Error, ErrorKind, counted};
use glam::DVec3;
use roxmltree::{Document, Node, ParsingOptions};

/// Longest text, bytes.
const BYTES_MAX: usize = 8 << 20;
/// Most elements and attributes together.
const PARTS_MAX: usize = 120_000;
/// Deepest element.
const DEPTH_MAX: usize = 250;

/// Parses a text with nothing in it that fetches or unfolds anything (no document type).
pub(super) fn parse(text: &str) -> Result<Document<'_>, Error> {
    let refuse = |what: &str| Error::of(ErrorKind::Malformed, what);
    let parts = text.bytes().filter(|byte| matches!(byte, b'<' | b'=')).count();
    if text.len() > BYTES_MAX || parts > PARTS_MAX {
        return Err(refuse("the model is too large")
            .got(format!("{}, elements and attributes about {parts}", counted(text.len(), "byte")))
            .allowed(format!("{BYTES_MAX} bytes, {PARTS_MAX} elements and attributes")));
    }
    // Told before parsing: every level costs the parser a call.
    let (mut depth, mut deepest, bytes) = (0_usize, 0, text.as_bytes());
    for (at, byte) in bytes.iter().enumerate() {
        match (byte, bytes.get(at + 1)) {
            (b'<', Some(b'/')) | (b'/', Some(b'>')) => depth = depth.saturating_sub(1),
            (b'<', Some(next)) if next.is_ascii_alphabetic() || *next == b'_' => depth += 1,
            _ => (),
        }
        deepest = deepest.max(depth);
    }
    if deepest > DEPTH_MAX {
        return Err(refuse("elements stand too deep in one another")
            .got(counted(deepest, "level"))
            .allowed(format!("{DEPTH_MAX}")));
    }
    let options = ParsingOptions {
        allow_dtd: false,
        nodes_limit: u32::try_from(3 * PARTS_MAX).unwrap_or(u32::MAX),
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(text, options)
        .map_err(|cause| refuse("the file is not whole XML").got(shown(&cause.to_string())))?;
    let depth = document.descendants().map(|node| node.ancestors().count()).max();
    if depth > Some(DEPTH_MAX + 2) {
        return Err(refuse("elements stand too deep in one another"));
    }
    Ok(document)
}

/// Where an element stands, in words.
pub(super) fn place(node: Node<'_, '_>) -> String {
    let row = node.document().text_pos_at(node.range().start).row;
    let tag = shown(node.tag_name().name());
    match node.attribute("name") {
        Some(name) => format!("line {row}, <{tag}> {:?}", shown(name)),
        None => format!("line {row}, <{tag}>"),
    }
}

/// The first child element of this name.
pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    children(node, name).next()
}

/// All child elements of this name.
pub(super) fn children<'a, 'i>(
    node: Node<'a, 'i>,
    name: &str,
) -> impl Iterator<Item = Node<'a, 'i>> {
    let name = name.to_owned();
    node.children().filter(move |child| child.has_tag_name(name.as_str()))
}

/// Numbers in an attribute's text: finite, at most as many as asked for.
pub(super) fn numbers(
    node: Node<'_, '_>,
    key: &str,
    text: &str,
    most: usize,
) -> Result<Vec<f64>, Error> {
    let words: Vec<&str> = text.split_whitespace().take(most + 1).collect();
    let values: Option<Vec<f64>> = words
        .iter()
        .map(|word| word.parse().ok().filter(|value: &f64| value.is_finite()))
        .collect();
    match values {
        Some(values) if values.len() <= most => Ok(values),
        _ => Err(wrong(
            node,
            key,
            text,
            &format!("up to {most}", most = counted(most, "finite number")),
        )),
    }
}

/// One number.
pub(super) fn number(node: Node<'_, '_>, key: &str, text: &str) -> Result<f64, Error> {
    match numbers(node, key, text, 1)?.as_slice() {
        [value] => Ok(*value),
        _ => Err(wrong(node, key, text, "a number")),
    }
}

/// Three numbers.
pub(super) fn vector(node: Node<'_, '_>, key: &str, text: &str) -> Result<DVec3, Error> {
    match numbers(node, key, text, 3)?.as_slice() {
        [x, y, z] => Ok(DVec3::new(*x, *y, *z)),
        _ => Err(wrong(node, key, text, "three numbers")),
    }
}

/// An attribute with a value that cannot be.
pub(super) fn wrong(node: Node<'_, '_>, key: &str, text: &str, allowed: &str) -> Error {
    Error::of(ErrorKind::Malformed, "the model has a value here that cannot be used")
        .at(format!("{}, {key}", place(node)))
        .got(format!("{:?}", shown(text)))
        .allowed(allowed)
}
