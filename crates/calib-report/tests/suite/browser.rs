//! A page in a headless browser, in a frame of exactly the size that is asked for.
//!
//! A window has a smallest width of its own; a frame does not. The page inside speaks to the one around it by message.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What a page did in the browser.
pub struct Seen {
    /// What the script inside the page reported.
    pub told: serde_json::Value,
    /// Lines of the console.
    pub console: Vec<String>,
    /// Hosts that were asked for something over the network, without the browser's own housekeeping.
    pub hosts: Vec<String>,
}

/// Hosts that Chromium talks to about itself, whatever page it shows.
const HOUSEKEEPING: [&str; 4] = ["google.com", "googleapis.com", "gstatic.com", "gvt1.com"];

/// Opens `page` with `script` (the body of a function whose value is reported) in a frame of the given size; `None` when no
/// browser is installed.
pub fn open(name: &str, page: &str, [width, height]: [u32; 2], script: &str) -> Option<Seen> {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("browser-{name}-{width}"));
    std::fs::create_dir_all(&folder).expect("a folder");
    let write = |file: &str, text: String| {
        let path = folder.join(file);
        std::fs::write(&path, text).expect("a file");
        path
    };
    let inside = format!(
        "<script>addEventListener('load', () => setTimeout(async () => {{
            const run = async () => {{ {script} }};
            const told = await run().catch(e => ({{ failed: String(e) }}));
            parent.postMessage(JSON.stringify(told), '*');
        }}, 300));</script></body>"
    );
    write("report.html", page.replace("</body>", &inside));
    let around = write(
        "around.html",
        format!(
            "<body style='margin:0'><iframe src='report.html' width='{width}' height='{height}' style='border:0'></iframe>\
             <script>addEventListener('message', e => {{ document.body.dataset.told = e.data; }});</script></body>"
        ),
    );
    let net = folder.join("net.json");
    for browser in ["chromium", "chromium-browser", "google-chrome"] {
        let Ok(out) = run(browser, &folder, &net, &around) else {
            continue;
        };
        let dom = String::from_utf8_lossy(&out.stdout).into_owned();
        let told = dom
            .split("data-told=\"")
            .nth(1)
            .and_then(|rest| rest.split('"').next())
            .unwrap_or_else(|| panic!("{name}: the page reported nothing"))
            .replace("&quot;", "\"")
            .replace("&lt;", "<")
            .replace("&gt;", ">")
            .replace("&amp;", "&");
        let log = String::from_utf8_lossy(&out.stderr).into_owned();
        return Some(Seen {
            told: serde_json::from_str(&told).expect("JSON"),
            console: log
                .lines()
                .filter(|line| line.contains("CONSOLE"))
                .map(str::to_owned)
                .collect(),
            hosts: hosts(&std::fs::read_to_string(&net).unwrap_or_default()),
        });
    }
    None
}

fn run(
    browser: &str,
    folder: &Path,
    net: &Path,
    page: &Path,
) -> std::io::Result<std::process::Output> {
    Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--no-first-run",
        ])
        .args([
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
        ])
        .args([
            "--enable-logging=stderr",
            "--dump-dom",
            "--virtual-time-budget=4000",
        ])
        .args(["--window-size=1400,1000", "--hide-scrollbars"])
        .arg(format!("--log-net-log={}", net.display()))
        .arg(format!(
            "--user-data-dir={}",
            folder.join("profile").display()
        ))
        .arg(format!("file://{}", page.display()))
        .output()
}

fn hosts(log: &str) -> Vec<String> {
    let mut hosts: Vec<String> = log
        .split("\"url\":\"")
        .skip(1)
        .filter_map(|rest| rest.split('"').next())
        .filter_map(|url| {
            let (scheme, rest) = url.split_once("://")?;
            let host = rest.split(['/', ':', '?']).next()?;
            let own = HOUSEKEEPING
                .iter()
                .any(|own| host == *own || host.ends_with(&format!(".{own}")));
            (matches!(scheme, "http" | "https" | "ws" | "wss") && !own).then(|| host.to_owned())
        })
        .collect();
    hosts.sort();
    hosts.dedup();
    hosts
}

/// A script that tells where each answer is seen: in the first screen, or by a link that stands in it and leads to it.
pub fn first_screen(ids: &[&str]) -> String {
    let mut list = String::new();
    for id in ids {
        let _ = write!(list, "'{id}',");
    }
    format!(
        "const wide = innerWidth, high = innerHeight;
        const inside = r => r.width > 0 && r.height > 0 && r.left >= 0 && r.right <= wide && r.top >= 0 && r.bottom <= high;
        const shown = e => {{ const s = getComputedStyle(e); return s.visibility !== 'hidden' && s.display !== 'none' && Number(s.opacity) > 0; }};
        const told = {{ wide, high, overflow: document.documentElement.scrollWidth - wide,
            loaded: performance.getEntriesByType('resource').length, answers: {{}} }};
        document.documentElement.style.scrollBehavior = 'auto';
        for (const id of [{list}]) {{
            scrollTo(0, 0);
            const heading = document.getElementById(id), card = heading && heading.closest('section');
            if (!card) {{ told.answers[id] = 'absent'; continue; }}
            if (shown(card) && inside(card.getBoundingClientRect())) {{ told.answers[id] = 'seen'; continue; }}
            const link = [...document.querySelectorAll('a[href=\"#' + id + '\"]')].find(a => shown(a) && inside(a.getBoundingClientRect()));
            if (!link) {{ told.answers[id] = 'hidden'; continue; }}
            link.click();
            await new Promise(next => setTimeout(next, 20));
            told.answers[id] = inside(heading.getBoundingClientRect()) ? 'linked' : 'astray';
        }}
        return told;"
    )
}
