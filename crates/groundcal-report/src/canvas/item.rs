//! What a drawing consists of. How things look is a parameter: [`Ink`] where the drawing stands alone, [`Class`] where the style
//! sheet of a page says it.

/// x to the right, y down, in units of the canvas.
pub type Point = [f64; 2];

/// Red, green and blue.
pub type Color = [u8; 3];

/// Where a text's reference point is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Where it begins.
    Start,
    /// Half way.
    Middle,
    /// Where it ends.
    End,
}

/// A look by its names in a page's style sheet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Class(pub String);

impl From<&str> for Class {
    fn from(names: &str) -> Self {
        Self(names.to_string())
    }
}

impl From<String> for Class {
    fn from(names: String) -> Self {
        Self(names)
    }
}

/// A look in colours: each of outline, area or letters draws what has such a thing.
#[derive(Debug, Clone, PartialEq)]
pub enum Ink {
    /// The outline of a shape.
    Line {
        /// Its colour.
        color: Color,
        /// Its width.
        width: f64,
        /// Lengths of dashes and gaps; empty: solid.
        dash: &'static [f64],
    },
    /// The inside of a shape.
    Area {
        /// Its colour.
        color: Color,
        /// From 0, nothing, to 1.
        opacity: f64,
    },
    /// A text.
    Letters {
        /// Their colour.
        color: Color,
        /// The font's size.
        size: f64,
    },
}

/// A symbol that is drawn at many places.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    /// As large as the line is wide.
    Dot,
    /// Two diagonals of a square of this side.
    Cross(f64),
    /// A square of this side.
    Square(f64),
}

/// Something with an outline.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A straight line.
    Line(Point, Point),
    /// A rectangle: its corner at the left above, width and height.
    Rectangle(Point, [f64; 2]),
    /// A circle: centre and radius.
    Circle(Point, f64),
    /// Lines through points, all of them closed or none.
    Runs {
        /// The points of each line.
        runs: Vec<Vec<Point>>,
        /// Whether each returns to where it began.
        closed: bool,
    },
    /// One symbol at many places.
    Marks(Mark, Vec<Point>),
}

impl Shape {
    /// An open line through points.
    pub fn polyline(points: Vec<Point>) -> Self {
        Shape::Runs { runs: vec![points], closed: false }
    }

    /// A closed line through points.
    pub fn polygon(points: Vec<Point>) -> Self {
        Shape::Runs { runs: vec![points], closed: true }
    }

    /// Whether there is nothing to draw.
    pub(crate) fn is_empty(&self) -> bool {
        match self {
            Shape::Runs { runs, .. } => runs.iter().all(Vec::is_empty),
            Shape::Marks(_, places) => places.is_empty(),
            _ => false,
        }
    }
}

/// Part of a picture that is shown.
#[derive(Debug, Clone, PartialEq)]
pub struct Clip {
    /// Its name, once in a page.
    pub id: String,
    /// Its outline.
    pub outline: Vec<Point>,
}

/// A photograph in a page.
#[derive(Debug, Clone, PartialEq)]
pub enum Picture {
    /// Defined elsewhere in the page, under this name.
    Shared(String),
    /// Here.
    Own {
        /// `data:image/...`.
        uri: String,
        /// Where it begins, left above.
        corner: Point,
        /// Width and height.
        size: [f64; 2],
        /// Its look.
        class: Class,
        /// What of it is shown.
        clip: Clip,
    },
}

/// Something drawn.
#[derive(Debug, Clone, PartialEq)]
pub enum Item<L> {
    /// An outline, an area, or both.
    Shape {
        /// What.
        shape: Shape,
        /// In which look.
        look: L,
    },
    /// A line of text.
    Text {
        /// On the base line.
        at: Point,
        /// The words.
        text: String,
        /// Where `at` is in it.
        anchor: Anchor,
        /// Turned by a quarter, to be read upwards.
        upwards: bool,
        /// In which look.
        look: L,
    },
    /// Items that a page can hide together.
    Layer {
        /// By this name.
        name: &'static str,
        /// These.
        items: Vec<Item<L>>,
    },
    /// A photograph.
    Picture(Picture),
}

/// A drawing: later items lie upon earlier ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Canvas<L> {
    /// Left, top, width, height of what is shown.
    pub view: [f64; 4],
    /// What is drawn.
    pub items: Vec<Item<L>>,
}

impl<L> Canvas<L> {
    /// An empty one, whose coordinates run over left, top, width, height.
    pub fn new(view: [f64; 4]) -> Self {
        Self { view, items: Vec::new() }
    }

    /// Adds a shape; nothing where it has no points.
    pub fn shape(&mut self, look: impl Into<L>, shape: Shape) -> &mut Self {
        if !shape.is_empty() {
            self.items.push(Item::Shape { shape, look: look.into() });
        }
        self
    }

    /// Adds a straight line.
    pub fn line(&mut self, look: impl Into<L>, from: Point, to: Point) -> &mut Self {
        self.shape(look, Shape::Line(from, to))
    }

    /// Adds a rectangle by its corner at the left above and its size; a negative size is none.
    pub fn rectangle(&mut self, look: impl Into<L>, corner: Point, [width, height]: [f64; 2]) -> &mut Self {
        self.shape(look, Shape::Rectangle(corner, [width.max(0.0), height.max(0.0)]))
    }

    /// Adds a circle.
    pub fn circle(&mut self, look: impl Into<L>, centre: Point, radius: f64) -> &mut Self {
        self.shape(look, Shape::Circle(centre, radius))
    }

    /// Adds a text on its base line.
    pub fn text(&mut self, look: impl Into<L>, at: Point, anchor: Anchor, text: &str) -> &mut Self {
        self.items.push(Item::Text { at, text: text.into(), anchor, upwards: false, look: look.into() });
        self
    }

    /// Adds a text that is read upwards, its middle at the place.
    pub fn text_upwards(&mut self, look: impl Into<L>, at: Point, text: &str) -> &mut Self {
        let (text, look) = (text.into(), look.into());
        self.items.push(Item::Text { at, text, anchor: Anchor::Middle, upwards: true, look });
        self
    }

    /// Adds items that a page can hide together.
    pub fn layer(&mut self, name: &'static str, draw: impl FnOnce(&mut Self)) -> &mut Self {
        let mut inner = Self::new(self.view);
        draw(&mut inner);
        self.items.push(Item::Layer { name, items: inner.items });
        self
    }

    /// Adds a photograph.
    pub fn picture(&mut self, picture: Picture) -> &mut Self {
        self.items.push(Item::Picture(picture));
        self
    }
}
