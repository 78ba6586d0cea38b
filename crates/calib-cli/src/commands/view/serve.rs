//! The files of one folder over HTTP, to this computer only.
//!
//! Only GET and HEAD, only regular files that lie in the folder itself, only requests that name this computer as their host (a
//! page of another site cannot read the answers), one request for each connection.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use calib_files::input;

/// A request's head is shorter; what is longer is refused.
const HEAD: usize = 8192;

/// The largest file that is served, bytes: a page with its meshes has less.
const LARGEST: u64 = 1 << 28;

/// A browser sends its request at once.
const PATIENCE: Duration = Duration::from_secs(5);

/// Connections at once: a browser opens six.
const CONNECTIONS: usize = 16;

/// Serves until the program ends.
pub(super) fn serve(listener: &TcpListener, folder: &Path, port: u16) {
    let open = Arc::new(AtomicUsize::new(0));
    for stream in listener.incoming().flatten() {
        let (folder, open) = (folder.to_owned(), Arc::clone(&open));
        if open.fetch_add(1, Ordering::SeqCst) >= CONNECTIONS {
            open.fetch_sub(1, Ordering::SeqCst);
            continue;
        }
        thread::spawn(move || {
            // A browser that went away is not an error.
            let _ = answer(stream, &folder, port);
            open.fetch_sub(1, Ordering::SeqCst);
        });
    }
}

fn answer(mut stream: TcpStream, folder: &Path, port: u16) -> std::io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut head = Vec::new();
    let mut part = [0; 1024];
    while !head.windows(4).any(|w| w == b"\r\n\r\n") && head.len() < HEAD {
        match stream.read(&mut part)? {
            0 => break,
            n => head.extend_from_slice(&part[..n]),
        }
    }
    let (status, kind, body, bare) = match request(&head, port) {
        Err(status) => (status, "text/plain", status.as_bytes().to_vec(), false),
        Ok(asked) => match asked
            .file(folder)
            .and_then(|f| Some((kind(&f), input::read(&f, LARGEST).ok()?)))
        {
            Some((kind, body)) => ("200 OK", kind, body, asked.head_only),
            None => (
                "404 Not Found",
                "text/plain",
                b"404 Not Found".to_vec(),
                asked.head_only,
            ),
        },
    };
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nCross-Origin-Resource-Policy: same-origin\r\nConnection: close\r\n\r\n",
        body.len()
    )?;
    if !bare {
        stream.write_all(&body)?;
    }
    stream.flush()
}

/// What was asked for.
#[derive(Debug, PartialEq, Eq)]
struct Asked {
    /// Decoded, without the slash in front.
    name: String,
    head_only: bool,
}

impl Asked {
    /// The file in the folder, if it is one and lies there.
    fn file(&self, folder: &Path) -> Option<PathBuf> {
        let name = if self.name.is_empty() {
            super::PAGE
        } else {
            &self.name
        };
        let plain = !name.starts_with('.') && !name.contains(['/', '\\', ':', '\0']);
        let path = folder.join(name);
        // A link may lead out of the folder.
        let real = plain.then(|| path.canonicalize().ok()).flatten()?;
        (real.parent() == Some(folder) && real.is_file()).then_some(real)
    }
}

/// The request, or the status that refuses it.
fn request(head: &[u8], port: u16) -> Result<Asked, &'static str> {
    const BAD: &str = "400 Bad Request";
    let text = std::str::from_utf8(head).map_err(|_| BAD)?;
    let (head, _) = text.split_once("\r\n\r\n").ok_or(BAD)?;
    let mut lines = head.split("\r\n");
    let mut words = lines.next().unwrap_or_default().split(' ');
    let (method, target) = (words.next().unwrap_or_default(), words.next().ok_or(BAD)?);
    let head_only = match method {
        "GET" => false,
        "HEAD" => true,
        _ => return Err("405 Method Not Allowed"),
    };
    // Another site's name that was made to lead here is still in the request.
    let ours = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    let host = lines.find_map(|line| {
        let (key, value) = line.split_once(':')?;
        key.eq_ignore_ascii_case("host")
            .then(|| value.trim().to_owned())
    });
    if !host.is_some_and(|host| ours.contains(&host)) {
        return Err("403 Forbidden");
    }
    let path = target.split(['?', '#']).next().unwrap_or_default();
    let path = path.strip_prefix('/').ok_or(BAD)?;
    let name = decoded(path).ok_or(BAD)?;
    Ok(Asked { name, head_only })
}

/// A path without its percent signs.
fn decoded(path: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut rest = path.bytes();
    while let Some(byte) = rest.next() {
        if byte != b'%' {
            bytes.push(byte);
            continue;
        }
        let mut digit = || rest.next().and_then(|d| (d as char).to_digit(16));
        let (high, low) = (digit()?, digit()?);
        bytes.push((high * 16 + low) as u8);
    }
    String::from_utf8(bytes).ok()
}

fn kind(path: &Path) -> &'static str {
    match path.extension().and_then(|e| e.to_str()) {
        Some("html") => "text/html; charset=utf-8",
        Some("json") => "application/json",
        Some("svg") => "image/svg+xml",
        Some("glb") => "model/gltf-binary",
        Some("csv") => "text/csv; charset=utf-8",
        Some("md" | "yaml" | "urdf" | "sdf" | "py" | "txt") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_files::{make_folder, replace};

    fn asked(line: &str, host: &str) -> Result<Asked, &'static str> {
        request(
            format!("{line} HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes(),
            80,
        )
    }

    #[test]
    fn only_get_and_head_from_this_computer() {
        let name = |line: &str| asked(line, "localhost:80").map(|a| a.name);
        assert_eq!(name("GET /a%20b.csv?x=1"), Ok("a b.csv".to_owned()));
        assert_eq!(name("HEAD /"), Ok(String::new()));
        assert_eq!(name("POST /"), Err("405 Method Not Allowed"));
        assert_eq!(name("GET a"), Err("400 Bad Request"));
        assert_eq!(name("GET /%zz"), Err("400 Bad Request"));
        for host in ["evil.example", "evil.example:80", "127.0.0.1:81", ""] {
            assert_eq!(asked("GET /", host), Err("403 Forbidden"), "{host}");
        }
        assert_eq!(request(b"GET / HTTP/1.1\r\n\r\n", 80), Err("403 Forbidden"));
        assert_eq!(request(b"\xff\r\n\r\n", 80), Err("400 Bad Request"));
        assert_eq!(request(b"", 80), Err("400 Bad Request"));
    }

    #[test]
    fn only_regular_files_of_the_folder_itself() {
        let parent = tempfile::tempdir().expect("a folder");
        let parent = parent.path().canonicalize().expect("a folder");
        let folder = parent.join("results");
        for (path, text) in [
            (folder.join("report.html"), "page"),
            (folder.join("below/secret"), "no"),
            (folder.join(".hidden"), "no"),
            (parent.join("secret"), "no"),
        ] {
            make_folder(path.parent().expect("a folder")).expect("a folder");
            replace(&path, text.as_bytes()).expect("a file");
        }
        #[cfg(unix)]
        std::os::unix::fs::symlink(parent.join("secret"), folder.join("link")).expect("a link");
        let found = |name: &str| {
            let asked = Asked {
                name: name.to_owned(),
                head_only: false,
            };
            asked.file(&folder)
        };
        assert_eq!(found(""), Some(folder.join("report.html")));
        assert_eq!(found("report.html"), Some(folder.join("report.html")));
        let outside = parent.join("secret").display().to_string();
        for name in [
            "../secret",
            "..",
            ".",
            "below",
            "below/secret",
            ".hidden",
            "link",
            "absent",
            &outside,
            "..\\secret",
            "C:secret",
            "a\0b",
        ] {
            assert_eq!(found(name), None, "{name}");
        }
    }
}
