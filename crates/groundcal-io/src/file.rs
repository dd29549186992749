//! Bytes of files, bounded: what is no regular file (a device, a pipe) never ends or never begins, and is refused by its kind before
//! it is opened; what is too large is refused by its size before memory is taken.

use std::{
    fs::{File, Metadata},
    io::{ErrorKind, Read},
    path::Path,
};

use crate::error::IoError;

/// The words for what the system says.
fn unreadable(path: &Path, error: &std::io::Error) -> IoError {
    IoError::file(
        path,
        match error.kind() {
            ErrorKind::NotFound if path.symlink_metadata().is_ok() => {
                "is a link to something that does not exist".to_string()
            }
            ErrorKind::NotFound => "does not exist. Check the path".to_string(),
            ErrorKind::PermissionDenied => "cannot be read: no permission".to_string(),
            _ => format!("cannot be read: {error}"),
        },
    )
}

/// What a path that is neither a file nor a folder is.
fn kind(metadata: &Metadata) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = metadata.file_type();
        if kind.is_fifo() {
            return "a pipe";
        }
        if kind.is_socket() {
            return "a socket";
        }
        if kind.is_char_device() || kind.is_block_device() {
            return "a device";
        }
    }
    if metadata.is_dir() { "a folder" } else { "something else" }
}

/// Refuses what is no regular file.
pub(crate) fn check_is_file(path: &Path) -> Result<u64, IoError> {
    let metadata = path.metadata().map_err(|e| unreadable(path, &e))?;
    if metadata.is_file() {
        return Ok(metadata.len());
    }
    let kind = kind(&metadata);
    let help = if kind == "a folder" { "Name a file" } else { "Copy the data to a file first" };
    Err(IoError::file(path, format!("is {kind}, not a file. {help}")))
}

/// All bytes of a file that has at most `most`.
pub(crate) fn bytes(path: &Path, most: u64) -> Result<Vec<u8>, IoError> {
    let too_large = |length: u64| {
        IoError::file(path, format!("too large: {} MiB, at most {} MiB are read", length >> 20, most >> 20))
    };
    let length = check_is_file(path)?;
    if length > most {
        return Err(too_large(length));
    }
    let file = File::open(path).map_err(|e| unreadable(path, &e))?;
    let mut bytes = Vec::with_capacity(length as usize);
    // A file may grow while it is read, and some say 0 and never end.
    file.take(most + 1).read_to_end(&mut bytes).map_err(|e| unreadable(path, &e))?;
    if bytes.len() as u64 > most {
        return Err(too_large(bytes.len() as u64));
    }
    Ok(bytes)
}

/// The text of a file that has at most `most` bytes: UTF-8, or UTF-16 with its mark. `hint` says what was expected.
///
/// # Errors
/// [`IoError::File`] for what is no file, cannot be read, is larger or no text.
pub fn text(path: &Path, most: u64, hint: &str) -> Result<String, IoError> {
    let bytes = bytes(path, most)?;
    let utf16 = |units: Vec<u16>| {
        String::from_utf16(&units).map_err(|_| IoError::file(path, format!("no text: damaged UTF-16. {hint}")))
    };
    let pairs = |join: fn([u8; 2]) -> u16| bytes[2..].chunks_exact(2).map(|p| join([p[0], p[1]])).collect();
    match bytes.get(..2) {
        Some([0xff, 0xfe]) => return utf16(pairs(u16::from_le_bytes)),
        Some([0xfe, 0xff]) => return utf16(pairs(u16::from_be_bytes)),
        _ => {}
    }
    let mut text = String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        IoError::file(path, format!("no text in UTF-8 (byte {at}). {hint}"))
    })?;
    if text.starts_with('\u{feff}') {
        text.drain(..'\u{feff}'.len_utf8());
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_and_sizes_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, [0; 100]).unwrap();
        assert_eq!(bytes(&path, 100).unwrap().len(), 100);
        let says = |r: Result<Vec<u8>, IoError>, word: &str| {
            let message = r.unwrap_err().to_string();
            assert!(message.contains(word), "{message}");
        };
        says(bytes(&path, 99), "too large");
        says(bytes(folder.path(), 99), "a folder");
        says(bytes(&folder.path().join("b"), 99), "does not exist");
        #[cfg(unix)]
        {
            says(bytes(Path::new("/dev/zero"), 99), "a device");
            std::os::unix::fs::symlink("nothing", folder.path().join("c")).unwrap();
            says(bytes(&folder.path().join("c"), 99), "a link");
            let pipe = folder.path().join("pipe");
            // Without the program, nothing to try.
            if std::process::Command::new("mkfifo").arg(&pipe).status().is_ok_and(|s| s.success()) {
                says(bytes(&pipe, 99), "a pipe");
            }
        }
        #[cfg(target_os = "linux")]
        says(bytes(Path::new("/proc/kallsyms"), 99), "too large");
    }

    #[test]
    fn text_of_windows_programs_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let write = |bytes: &[u8]| std::fs::write(&path, bytes).unwrap();
        write(b"\xef\xbb\xbfa;b");
        assert_eq!(text(&path, 99, "").unwrap(), "a;b");
        write(b"\xff\xfea\0;\0");
        assert_eq!(text(&path, 99, "").unwrap(), "a;");
        write(b"ab\xff");
        assert!(text(&path, 99, "Save it as UTF-8").unwrap_err().to_string().contains("byte 2"));
    }
}
