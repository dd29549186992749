//! YAML and XML as one tree of named values, as far as calibration files use them.

use saphyr::{LoadableYamlNode, Scalar, Yaml};

use crate::{
    import::spelling::plain,
    limits::MAX_MARKUP_BYTES,
    text::{quoted, sentence},
};

/// How deep values may be nested; calibrations need four levels.
const MAX_DEPTH: usize = 32;
/// Columns before the first word of a line.
const MAX_LEAD: usize = 256;

/// A value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Node {
    /// A number.
    Number(f64),
    /// A word, or nothing.
    Text(String),
    /// Values in order.
    List(Vec<Node>),
    /// Named values in order.
    Map(Vec<(String, Node)>),
}

impl Node {
    /// The first document of a YAML text. OpenCV's `%YAML:1.0` is no directive that YAML knows, and is dropped; tags such as
    /// `!!opencv-matrix` are ignored.
    pub(crate) fn from_yaml(text: &str) -> Result<Self, String> {
        if text.len() > MAX_MARKUP_BYTES {
            return Err(too_long());
        }
        let mut body = text;
        if text.starts_with("%YAML") {
            body = text.split_once('\n').map_or("", |t| t.1);
        }
        check_nesting(body)?;
        let documents = Yaml::load_from_str(body).map_err(|e| {
            let at = e.marker();
            format!("damaged YAML, or no format that is read (line {}, column {})", at.line(), at.col() + 1)
        })?;
        match documents.first() {
            Some(document) => from_yaml_node(document, 0),
            None => Ok(Node::Map(Vec::new())),
        }
    }

    /// The values inside the root element of an XML text, as OpenCV writes it.
    pub(crate) fn from_xml(text: &str) -> Result<Self, String> {
        if text.len() > MAX_MARKUP_BYTES {
            return Err(too_long());
        }
        check_elements(text)?;
        let document =
            roxmltree::Document::parse(text).map_err(|e| format!("damaged XML: {}", sentence(&e.to_string())))?;
        from_xml_node(&document.root_element(), 0)
    }

    /// The same tree of a JSON text.
    pub(crate) fn from_json(value: serde_json::Value) -> Self {
        use serde_json::Value;
        match value {
            Value::Null => Node::Text(String::new()),
            Value::Bool(v) => Node::Number(f64::from(u8::from(v))),
            Value::Number(v) => Node::Number(v.as_f64().unwrap_or(f64::NAN)),
            Value::String(v) => Node::Text(v),
            Value::Array(items) => Node::List(items.into_iter().map(Node::from_json).collect()),
            Value::Object(entries) => Node::Map(entries.into_iter().map(|(k, v)| (k, Node::from_json(v))).collect()),
        }
    }

    /// The named values.
    pub(crate) fn entries(&self) -> &[(String, Node)] {
        match self {
            Node::Map(entries) => entries,
            _ => &[],
        }
    }

    /// Whether a flag is set: a number that is not zero, or a word that says yes.
    pub(crate) fn is_set(&self) -> bool {
        match self.number() {
            Some(number) => number != 0.0,
            None => self.text().is_some_and(|t| matches!(t.to_ascii_lowercase().as_str(), "true" | "yes" | "on")),
        }
    }

    /// Names of the values.
    pub(crate) fn keys(&self) -> impl Iterator<Item = &str> {
        self.entries().iter().map(|(k, _)| k.as_str())
    }

    /// The value of one of several spellings; case and separators do not matter.
    pub(crate) fn get(&self, names: &[&str]) -> Option<&Node> {
        let entries = self.entries();
        names.iter().find_map(|name| entries.iter().find(|(k, _)| plain(k) == plain(name))).map(|(_, v)| v)
    }

    /// As a number.
    pub(crate) fn number(&self) -> Option<f64> {
        match self {
            Node::Number(v) => Some(*v),
            Node::Text(text) => text.trim().parse().ok(),
            _ => None,
        }
    }

    /// As a word.
    pub(crate) fn text(&self) -> Option<&str> {
        match self {
            Node::Text(text) => Some(text.trim()),
            _ => None,
        }
    }

    /// The numbers of a list, of lists in a list, of words in a text, or of the `data` of a matrix whose `rows` and `cols` agree.
    pub(crate) fn numbers(&self) -> Result<Vec<f64>, String> {
        match self {
            Node::Number(v) => Ok(vec![*v]),
            Node::Text(text) => text
                .split_whitespace()
                .map(|word| word.parse().map_err(|_| format!("{} is not a number", quoted(word))))
                .collect(),
            Node::List(items) => {
                let mut all = Vec::new();
                for item in items {
                    all.extend(item.numbers()?);
                }
                Ok(all)
            }
            Node::Map(_) => {
                let data = self.get(&["data"]).ok_or("a matrix without data")?.numbers()?;
                let side = |name: &str| self.get(&[name]).and_then(Node::number);
                if let (Some(rows), Some(columns)) = (side("rows"), side("cols"))
                    && rows * columns != data.len() as f64
                {
                    return Err(format!("a matrix of {rows} rows and {columns} columns has {} numbers", data.len()));
                }
                Ok(data)
            }
        }
    }
}

/// Refuses deep nesting before a parser, which may recurse, sees it: brackets, and columns of indentation or of `- - -` before the
/// first word of a line (each level of a block takes one at least).
fn check_nesting(yaml: &str) -> Result<(), String> {
    let mut depth = 0usize;
    for line in yaml.lines() {
        let lead = line.bytes().take_while(|b| matches!(b, b' ' | b'\t' | b'-' | b'?' | b':')).count();
        for b in line.bytes() {
            match b {
                b'[' | b'{' => depth += 1,
                b']' | b'}' => depth = depth.saturating_sub(1),
                _ => {}
            }
            if depth > MAX_DEPTH || lead > MAX_LEAD {
                return Err("no calibration: values nested too deep".into());
            }
        }
    }
    Ok(())
}

fn too_long() -> String {
    format!("no calibration: more than {} MiB of text", MAX_MARKUP_BYTES >> 20)
}

/// Refuses deep nesting of elements of XML.
fn check_elements(xml: &str) -> Result<(), String> {
    let mut depth = 0usize;
    for (at, _) in xml.match_indices(['<', '/']) {
        let next = xml.as_bytes().get(at + 1);
        match (xml.as_bytes()[at], next) {
            (b'<', Some(b'/')) | (b'/', Some(b'>')) => depth = depth.saturating_sub(1),
            (b'<', Some(b'!' | b'?')) | (b'/', _) => {}
            _ => depth += 1,
        }
        if depth > MAX_LEAD {
            return Err("no calibration: XML elements nested too deep".into());
        }
    }
    Ok(())
}

fn from_yaml_node(node: &Yaml, depth: usize) -> Result<Node, String> {
    if depth > MAX_DEPTH {
        return Err(format!("no calibration: values nested more than {MAX_DEPTH} deep"));
    }
    Ok(match node {
        Yaml::Value(Scalar::Integer(v)) => Node::Number(*v as f64),
        Yaml::Value(Scalar::FloatingPoint(v)) => Node::Number(v.into_inner()),
        Yaml::Value(Scalar::Boolean(v)) => Node::Number(f64::from(u8::from(*v))),
        Yaml::Value(Scalar::String(v)) => Node::Text(v.to_string()),
        Yaml::Representation(v, ..) => Node::Text(v.to_string()),
        Yaml::Value(Scalar::Null) | Yaml::Alias(_) | Yaml::BadValue => Node::Text(String::new()),
        Yaml::Tagged(_, inner) => from_yaml_node(inner, depth + 1)?,
        Yaml::Sequence(items) => {
            Node::List(items.iter().map(|i| from_yaml_node(i, depth + 1)).collect::<Result<_, String>>()?)
        }
        Yaml::Mapping(entries) => {
            let mut map = Vec::with_capacity(entries.len());
            for (key, value) in entries {
                let name = match from_yaml_node(key, depth + 1)? {
                    Node::Text(text) => text,
                    Node::Number(v) => v.to_string(),
                    _ => continue,
                };
                map.push((name, from_yaml_node(value, depth + 1)?));
            }
            Node::Map(map)
        }
    })
}

fn from_xml_node(node: &roxmltree::Node, depth: usize) -> Result<Node, String> {
    if depth > MAX_DEPTH {
        return Err(format!("no calibration: elements nested more than {MAX_DEPTH} deep"));
    }
    let mut entries = Vec::new();
    for child in node.children().filter(roxmltree::Node::is_element) {
        entries.push((child.tag_name().name().to_string(), from_xml_node(&child, depth + 1)?));
    }
    Ok(if entries.is_empty() { Node::Text(node.text().unwrap_or_default().to_string()) } else { Node::Map(entries) })
}
