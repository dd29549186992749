//! Text in letters of one width: tables whose columns never run together, labelled facts, paragraphs.

/// What a line says, for terminals that can show it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// As any other.
    Plain,
    /// What matters, without being a doubt.
    Strong,
    /// Something is as it should be.
    Good,
    /// Something to beware of.
    Doubt,
    /// Something is wrong.
    Bad,
    /// What is there for reference.
    Faint,
}

/// A line of text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// Without its end.
    pub text: String,
    /// What it says.
    pub look: Look,
}

impl Line {
    /// As any other.
    pub fn plain(text: &str) -> Self {
        Self { text: text.into(), look: Look::Plain }
    }

    /// The lines of a text, of one look.
    pub fn all(text: &str, look: Look) -> Vec<Self> {
        text.lines().map(|line| Self { text: line.into(), look }).collect()
    }
}

/// Columns of a line unless the reader's terminal says otherwise.
pub const WIDTH: usize = 80;
/// Blanks between columns: as many as there is room for.
const GAPS: [usize; 2] = [2, 1];
/// Names are not cut below this.
const MIN_NAME: usize = 8;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// At the left; may be cut.
    Name,
    /// At the right.
    Number,
    /// Words at the left, never cut.
    Note,
}

/// A column of a [`Table`].
#[derive(Debug, Clone)]
struct Column {
    /// Lines of its heading.
    heads: Vec<String>,
    kind: Kind,
}

/// A table. Where the line is too short for it, names are cut in their middle; where that is not enough, the table is written in
/// pieces below one another, each beginning with the names.
#[derive(Debug, Clone, Default)]
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// Without columns.
    pub fn new() -> Self {
        Self::default()
    }

    fn column(mut self, head: &str, kind: Kind) -> Self {
        self.columns.push(Column { heads: head.split('\n').map(str::to_string).collect(), kind });
        self
    }

    /// Adds a column of names; a heading may have several lines.
    #[must_use]
    pub fn name(self, head: &str) -> Self {
        self.column(head, Kind::Name)
    }

    /// Adds a column of numbers; a heading may have several lines.
    #[must_use]
    pub fn number(self, head: &str) -> Self {
        self.column(head, Kind::Number)
    }

    /// Adds a column of words, which are never cut; a heading may have several lines.
    #[must_use]
    pub fn note(self, head: &str) -> Self {
        self.column(head, Kind::Note)
    }

    /// Adds a row: a cell a column, in their order; what is missing is empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        let mut cells: Vec<String> = cells.into_iter().collect();
        cells.resize(self.columns.len(), String::new());
        self.rows.push(cells);
    }

    /// Leaves out the columns in which no row has a value.
    #[must_use]
    pub fn without_empty_columns(mut self) -> Self {
        let has_value = |i: usize| self.rows.iter().any(|row| !matches!(row[i].as_str(), "" | "-"));
        let kept: Vec<usize> = (0..self.columns.len()).filter(|&i| has_value(i)).collect();
        self.columns = kept.iter().map(|&i| self.columns[i].clone()).collect();
        for row in &mut self.rows {
            *row = kept.iter().map(|&i| row[i].clone()).collect();
        }
        self
    }

    /// The lines, none longer than `width` unless a single number is.
    pub fn lines(&self, width: usize) -> Vec<String> {
        let mut widths: Vec<usize> = (0..self.columns.len()).map(|i| self.width_of(i)).collect();
        let all: Vec<usize> = (0..self.columns.len()).collect();
        let total = |widths: &[usize], columns: &[usize], gap: usize| {
            columns.iter().map(|&i| widths[i]).sum::<usize>() + gap * columns.len().saturating_sub(1)
        };
        let gap = GAPS.into_iter().find(|gap| total(&widths, &all, *gap) <= width).unwrap_or(GAPS[1]);
        // The longest names give way first.
        while total(&widths, &all, gap) > width {
            let names = all.iter().filter(|&&i| self.columns[i].kind == Kind::Name && widths[i] > MIN_NAME);
            let Some(&longest) = names.max_by_key(|&&i| widths[i]) else { break };
            widths[longest] -= 1;
        }
        if total(&widths, &all, gap) <= width {
            return self.piece(&all, &widths, gap);
        }
        let key: Vec<usize> = all.iter().copied().take_while(|&i| self.columns[i].kind == Kind::Name).collect();
        let mut pieces: Vec<Vec<usize>> = Vec::new();
        for &i in &all[key.len()..] {
            match pieces.last_mut() {
                Some(piece) if total(&widths, piece, gap) + gap + widths[i] <= width => piece.push(i),
                _ => pieces.push(key.iter().copied().chain([i]).collect()),
            }
        }
        let mut lines = Vec::new();
        for piece in pieces {
            if !lines.is_empty() {
                lines.push(String::new());
            }
            lines.extend(self.piece(&piece, &widths, gap));
        }
        lines
    }

    /// The lines, each ended.
    pub fn text(&self, width: usize) -> String {
        self.lines(width).iter().map(|line| format!("{line}\n")).collect()
    }

    /// Of its longest cell.
    fn width_of(&self, i: usize) -> usize {
        let cells = self.rows.iter().map(|row| &row[i]);
        self.columns[i].heads.iter().chain(cells).map(|text| text.chars().count()).max().unwrap_or(0)
    }

    /// What the names of all columns share.
    fn alike(&self) -> [usize; 2] {
        let columns = (0..self.columns.len()).filter(|&i| self.columns[i].kind == Kind::Name);
        let names = columns.flat_map(|i| self.rows.iter().map(move |row| row[i].as_str()));
        shared_letters(names.filter(|name| !name.is_empty()))
    }

    fn piece(&self, columns: &[usize], widths: &[usize], gap: usize) -> Vec<String> {
        let heads = columns.iter().map(|&i| self.columns[i].heads.len()).max().unwrap_or(0);
        // Headings stand on the first row.
        let head = |i: usize, line: usize| {
            let own = &self.columns[i].heads;
            (line + own.len()).checked_sub(heads).map_or("", |line| own[line].as_str())
        };
        let head_lines = (0..heads).map(|line| columns.iter().map(|&i| head(i, line)).collect::<Vec<_>>());
        let row_lines = self.rows.iter().map(|row| columns.iter().map(|&i| row[i].as_str()).collect());
        let blanks = " ".repeat(gap);
        let alike = self.alike();
        head_lines
            .chain(row_lines)
            .map(|cells: Vec<&str>| {
                let cells: Vec<String> = columns
                    .iter()
                    .zip(cells)
                    .map(|(&i, cell)| match self.columns[i].kind {
                        Kind::Name => format!("{:<1$}", shortened(cell, alike, widths[i]), widths[i]),
                        Kind::Number => format!("{cell:>0$}", widths[i]),
                        Kind::Note => format!("{cell:<0$}", widths[i]),
                    })
                    .collect();
                cells.join(&blanks).trim_end().to_string()
            })
            .collect()
    }
}

/// At most so many letters. What a name shares with the others gives way first: the ending of the files, then the middle of the beginning; where that
/// is not enough, the middle.
fn shortened(text: &str, alike: [usize; 2], most: usize) -> String {
    const DOTS: &str = "...";
    let letters: Vec<char> = text.chars().collect();
    if letters.len() <= most {
        return text.to_string();
    }
    let [beginning, ending] = if alike[0] + alike[1] < letters.len() { alike } else { [0, 0] };
    let without_ending = &letters[..letters.len() - ending];
    if without_ending.len() <= most {
        return without_ending.iter().collect();
    }
    let kept = most.saturating_sub(DOTS.len());
    let own = without_ending.len() - beginning;
    let tail = if own <= kept { own.max(kept - kept / 2) } else { kept - kept / 2 };
    let head = kept - tail;
    let ends = [&without_ending[..head], &without_ending[without_ending.len() - tail..]];
    ends.map(|part| part.iter().collect::<String>()).join(DOTS)
}

/// How many letters all of several names begin with, and the letters of the file ending that all have.
fn shared_letters<'a>(names: impl Iterator<Item = &'a str> + Clone) -> [usize; 2] {
    let Some(first) = names.clone().next() else { return [0, 0] };
    let same = |name: &str| first.chars().zip(name.chars()).take_while(|(a, b)| a == b).count();
    let beginning = names.clone().map(same).min().unwrap_or(0);
    let ending = first.rfind('.').map_or("", |at| &first[at..]);
    let ending = if names.clone().all(|name| name.ends_with(ending)) { ending.chars().count() } else { 0 };
    // A single name, or one that the others begin with, keeps something of its own.
    [beginning.min(first.chars().count().saturating_sub(ending + 1)), ending]
}

/// Facts with their labels: two to a line where both fit into half of it, else one, continued below its beginning.
pub fn facts(facts: &[(&str, String)], width: usize) -> String {
    let indent = facts.iter().map(|(label, _)| label.chars().count() + 2).max().unwrap_or(0);
    let half = width / 2;
    let one = |(label, value): &(&str, String)| format!("{:<indent$}{value}", format!("{label}:"));
    // Two blanks stay between the columns.
    let narrow = |fact: &(&str, String)| one(fact).chars().count() + 2 <= half;
    let mut out = String::new();
    let mut rest = facts;
    while let [first, others @ ..] = rest {
        match others {
            [second, others @ ..] if narrow(first) && narrow(second) => {
                out.push_str(&format!("{:<half$}{}\n", one(first), one(second)));
                rest = others;
            }
            _ => {
                let lines = wrapped(&first.1, indent, width);
                out.push_str(&format!("{:<indent$}{}\n", format!("{}:", first.0), lines.trim_start()));
                rest = others;
            }
        }
    }
    out
}

/// Lines of at most `width` columns, indented, without an end of the last; a longer word stands alone.
pub fn wrapped(text: &str, indent: usize, width: usize) -> String {
    let mut out = String::new();
    let mut column = 0;
    for word in text.split_whitespace() {
        let length = word.chars().count();
        if column == 0 || column + 1 + length > width {
            if column > 0 {
                out.push('\n');
            }
            out.push_str(&" ".repeat(indent));
            column = indent;
        } else {
            out.push(' ');
            column += 1;
        }
        out.push_str(word);
        column += length;
    }
    out
}

/// A line of one letter.
pub fn rule(letter: char, width: usize) -> String {
    letter.to_string().repeat(width)
}

/// A text in the middle of a line.
pub fn centred(text: &str, width: usize) -> String {
    format!("{text:^width$}").trim_end().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motions(name: &str) -> Table {
        let mut table = Table::new().name("from").name("to").number("turn\n(deg)").number("rho").number("pitch");
        for i in 0..3 {
            let turn = format!("{}.0000 +-0.0001", 120 + i);
            table.row([
                format!("{name}{i}a.jpg"),
                format!("{name}{i}b.jpg"),
                turn,
                "1.0000 +-0.0001".into(),
                "-".into(),
            ]);
        }
        table
    }

    #[test]
    fn columns_never_run_together_whatever_the_width() {
        for name in ["", "a_rather_long_name_of_a_picture_"] {
            for width in 36..130 {
                let lines = motions(name).lines(width);
                assert!(lines.iter().all(|l| l.chars().count() <= width), "{width}: {lines:#?}");
                // Every number stands whole, with blanks about it.
                for turn in ["120.0000 +-0.0001", "121.0000 +-0.0001", "122.0000 +-0.0001"] {
                    let found = lines.iter().filter(|l| l.contains(turn)).count();
                    assert_eq!(found, 1, "{width}: {lines:#?}");
                }
                // And both names of each row, apart.
                for (a, b) in (0..3).map(|i| (format!("{i}a"), format!("{i}b"))) {
                    let row = |l: &&String| {
                        let words: Vec<&str> = l.split_whitespace().collect();
                        words.len() > 2 && words[0].contains(&a) && words[1].contains(&b)
                    };
                    assert!(lines.iter().any(|l| row(&l)), "{width}: {lines:#?}");
                }
            }
        }
    }

    #[test]
    fn a_table_that_fits_is_whole_and_one_that_does_not_repeats_its_names() {
        let table = motions("");
        assert_eq!(
            table.lines(80)[..3],
            [
                "                             turn",
                "from    to                  (deg)              rho  pitch",
                "0a.jpg  0b.jpg  120.0000 +-0.0001  1.0000 +-0.0001      -",
            ]
        );
        let pieces = table.lines(40);
        assert_eq!(pieces.iter().filter(|l| l.starts_with("0a.jpg 0b.jpg")).count(), 2, "{pieces:#?}");
        assert!(!table.without_empty_columns().text(80).contains("pitch"));
    }

    #[test]
    fn long_names_keep_what_is_their_own() {
        assert_eq!(shortened("IMG_20260101_120000.jpg", [0, 0], 12), "IMG_...0.jpg");
        assert_eq!(shortened("short.jpg", [0, 4], 12), "short.jpg");
        // The ending that all have goes first, then what all begin with.
        let names = ["grail00.jpg", "grail01.jpg", "grail17.jpg"];
        let alike = shared_letters(names.into_iter());
        assert_eq!(alike, [5, 4]);
        assert_eq!(names.map(|n| shortened(n, alike, 10)), ["grail00", "grail01", "grail17"]);
        let names = ["IMG_20260101_120000.jpg", "IMG_20260101_123456.jpg"];
        let alike = shared_letters(names.into_iter());
        assert_eq!(names.map(|n| shortened(n, alike, 12)), ["IMG_...20000", "IMG_...23456"]);
        assert_eq!(names.map(|n| shortened(n, alike, 8)), ["I...0000", "I...3456"]);
        // Names that are all alike, or no files.
        assert_eq!(shared_letters(["a.jpg", "a.jpg"].into_iter()), [0, 4]);
        assert_eq!(shared_letters(["", "view 1"].into_iter()), [0, 0]);
        assert_eq!(shared_letters(std::iter::empty::<&str>()), [0, 0]);
        let line = &motions("a_rather_long_name_of_a_picture_").lines(70)[2];
        assert!(line.starts_with("a_r") && line.contains("...") && line.contains("0b "), "{line}");
    }

    #[test]
    fn facts_share_a_line_where_they_fit() {
        let list = [
            ("Images", "12".to_string()),
            ("Method", "joint".into()),
            ("Scene", "floor; 5 links between attitudes".into()),
            ("Height sigma", "0.1 %".into()),
        ];
        assert_eq!(
            facts(&list, 60),
            "Images:       12              Method:       joint\n\
             Scene:        floor; 5 links between attitudes\n\
             Height sigma: 0.1 %\n"
        );
        let narrow = facts(&list, 30);
        assert!(narrow.contains("Scene:        floor; 5 links\n              between") && narrow.lines().count() > 4);
    }

    #[test]
    fn paragraphs_keep_to_their_width() {
        let text = wrapped("one two three four five", 2, 12);
        assert_eq!(text, "  one two\n  three four\n  five");
    }
}
