//! `report.html`: its data as snapshots, its rules as tests, its answers as a browser shows them.

use crate::{browser, examples};
use calib_report::{Report, View3d, answers, html::html, json, plots};
use insta::assert_snapshot;
use std::path::PathBuf;
use std::process::Command;

/// Limit for one file that is sent by mail.
const MAX_BYTES: usize = 3_000_000;

/// Plots in one snapshot: 50 lines each at most.
const PLOTS: usize = 3;

fn pages() -> Vec<(&'static str, Report, String)> {
    let view = examples::view();
    let page = |(name, report): (&'static str, Report)| {
        let text = html(&report, (name == "accepted").then_some(&view)).expect("a page");
        (name, report, text)
    };
    examples::all().into_iter().map(page).collect()
}

#[test]
fn the_plots_of_the_examples_as_data() {
    for (name, report) in examples::all() {
        let mut plots = plots::plots(&report);
        for plot in &mut plots {
            match &mut plot.kind {
                plots::PlotKind::Map { panels, .. } => {
                    panels.iter_mut().for_each(|panel| panel.points.truncate(2))
                }
                plots::PlotKind::Xy { series, band, .. } => {
                    series
                        .iter_mut()
                        .for_each(|series| series.points.truncate(3));
                    band.iter_mut().for_each(|band| band.points.truncate(3));
                }
                plots::PlotKind::Bars { bars, curve, .. } => {
                    bars.truncate(3);
                    curve.points.truncate(3);
                }
                plots::PlotKind::Matrix { names, rows, .. } => {
                    names.truncate(3);
                    rows.truncate(3);
                }
                plots::PlotKind::Rows { .. } | plots::PlotKind::Strips { .. } => {}
            }
        }
        for (i, some) in plots.chunks(PLOTS).enumerate() {
            let value = json::rounded(serde_json::to_value(some).expect("JSON"));
            assert_snapshot!(format!("plots_{name}_{}", i + 1), json::pretty(&value));
        }
    }
}

#[test]
fn the_view_of_the_example_as_data() {
    let mut view = examples::view().thinned();
    view.poses.truncate(1);
    view.clouds
        .iter_mut()
        .for_each(|cloud| cloud.points.truncate(2));
    for solid in &mut view.solids {
        solid.points.truncate(8);
        solid.faces.truncate(6);
    }
    let value = json::rounded(serde_json::to_value(&view).expect("JSON"));
    assert_snapshot!("view", json::pretty(&value));
}

#[test]
fn a_page_loads_nothing_and_is_small() {
    for (name, _, text) in pages() {
        assert!(text.len() < MAX_BYTES, "{name}: {} bytes", text.len());
        for forbidden in ["http://", "https://", "src=", "@import", "url(", "NaN"] {
            assert!(!text.contains(forbidden), "{name} contains {forbidden}");
        }
        assert!(text.contains("default-src 'none'"));
    }
}

#[test]
fn a_large_report_stays_below_the_limit() {
    let mut report = examples::rejected();
    let poses = report
        .verification
        .held_out
        .as_mut()
        .expect("held-out poses");
    poses.poses = poses.poses.iter().cycle().take(2000).cloned().collect();
    let mut view = examples::view();
    view.clouds[0].points = vec![[0.123_456, -1.234_567, 0.765_432]; 200_000];
    view.poses = view.poses.iter().cycle().take(2000).cloned().collect();
    let text = html(&report, Some(&view)).expect("a page");
    assert!(text.len() < MAX_BYTES, "{} bytes", text.len());
}

#[test]
fn ids_are_unique_and_every_link_has_a_target() {
    for (name, _, text) in pages() {
        let after = |mark: &str| {
            text.split(mark)
                .skip(1)
                .filter_map(|rest| rest.split('"').next())
                .map(str::to_owned)
                .collect::<Vec<_>>()
        };
        let mut ids = after(" id=\"");
        for target in after("href=\"#").into_iter().chain(
            after("aria-labelledby=\"")
                .iter()
                .flat_map(|ids| ids.split(' ').map(str::to_owned).collect::<Vec<_>>()),
        ) {
            assert!(ids.contains(&target), "{name}: nothing has the id {target}");
        }
        let count = ids.len();
        ids.sort();
        ids.dedup();
        assert_eq!(ids.len(), count, "{name}");
    }
}

#[test]
fn hostile_names_stay_text() {
    let mut report = examples::accepted();
    let hostile = "</script><img src=x onerror=alert(1)>`\"'&";
    report.robot = hostile.into();
    report.reasons = vec![hostile.into()];
    report.transforms[0].name = hostile.into();
    report.coverage[0].joint = hostile.into();
    report.reproduce = vec![hostile.into()];
    let mut view = examples::view();
    view.poses[0].name = hostile.into();
    let text = html(&report, Some(&view)).expect("a page");
    assert!(!text.contains("<img"), "markup got through");
}

/// On a narrow screen tables and code scroll; a shadow at the edge shows that there is more.
#[test]
fn what_scrolls_is_seen_to_scroll() {
    let text = html(&examples::accepted(), None).expect("a page");
    let style = text.split("</style>").next().expect("a style");
    let rule = style.split(".scroll, pre {").nth(1).expect("a rule");
    let rule = rule.split('}').next().expect("its end");
    // The covers move with the content, the shadows stay.
    assert_eq!(rule.matches("no-repeat local").count(), 2, "{rule}");
    assert_eq!(rule.matches("no-repeat scroll").count(), 2, "{rule}");
    let tables = text.matches("<table").count();
    let scrolled = text.matches("<div class=\"scroll\"").count();
    assert!(tables > 0);
    assert_eq!(scrolled, tables, "a table stands outside of what scrolls");
}

#[test]
fn a_report_without_a_view_has_no_script() {
    let text = html(&examples::rejected(), None).expect("a page");
    assert!(!text.contains("<script"));
    let text = html(&examples::rejected(), Some(&View3d::default())).expect("a page");
    assert!(!text.contains("<script"));
}

#[test]
fn markers_tell_their_residual_and_labels_do_not_collide() {
    let page = html(&examples::accepted(), Some(&examples::view())).expect("a page");
    let script = "<script>
        const canvas = document.getElementById('canvas'), box = canvas.getBoundingClientRect();
        const said = () => document.getElementById('view-status').textContent;
        const press = key => canvas.dispatchEvent(new KeyboardEvent('keydown', { key, cancelable: true }));
        canvas.setPointerCapture = () => {};
        const at = (kind, x, y) => canvas.dispatchEvent(new PointerEvent(kind, { clientX: box.left + x, clientY: box.top + y, pointerId: 1 }));
        const heard = [];
        press('m'); heard.push(said()); press('m'); heard.push(said()); press('M'); heard.push(said());
        press('PageDown');
        let clicked = 0;
        for (let x = 5; x < box.width && !clicked; x += 10) for (let y = 5; y < box.height; y += 10) {
            at('pointerdown', x, y); at('pointerup', x, y);
            if (said().includes('predicted minus measured')) { clicked = 1; break; }
        }
        heard.push(said());
        const names = [...document.querySelectorAll('#layers label')].find(l => l.textContent === 'Names and axes').firstChild;
        names.checked = true; names.dispatchEvent(new Event('change'));
        const labels = JSON.parse(canvas.dataset.labels);
        const apart = labels.every((a, i) => labels.every((b, j) => i === j || a[0] >= b[0] + b[2] - 1 || b[0] >= a[0] + a[2] - 1 || a[1] >= b[1] + b[3] || b[1] >= a[1] + a[3]));
        heard.push(String(labels.length > 2 && apart));
        document.body.dataset.heard = heard.join(' | ');
    </script></body>";
    let Some((dom, log)) = in_browser("residuals", &page.replace("</body>", script)) else {
        skipped_tests::skip(skipped_tests::NO_BROWSER);
        return;
    };
    assert!(!log.contains("CONSOLE"), "{log}");
    let heard = dom.split("data-heard=\"").nth(1);
    let heard = heard
        .and_then(|rest| rest.split('"').next())
        .expect("the script ran");
    let told: Vec<&str> = heard.split(" | ").collect();
    let held_out = examples::accepted().verification.held_out;
    let worst = held_out
        .and_then(|held_out| held_out.worst)
        .expect("a worst pose");
    let view = examples::view().beginning_with(&worst.pose);
    let marker = &view.poses[0].markers[0];
    let residual = marker.residual_m().expect("seen");
    let length = residual.iter().map(|x| x * x).sum::<f64>().sqrt();
    let length = format!("predicted minus measured {:.2} mm", length * 1e3);
    assert!(
        told[0].starts_with(&marker.name) && told[0].contains(&length),
        "{heard}"
    );
    assert!(
        told[1].starts_with(&view.poses[0].markers[1].name),
        "{heard}"
    );
    assert_eq!(told[2], told[0]);
    assert!(told[3].contains("predicted minus measured"), "{heard}");
    assert_eq!(told[4], "true", "{heard}");
}

#[test]
fn the_view_is_moved_by_keys_and_slider() {
    let page = html(&examples::accepted(), Some(&examples::view())).expect("a page");
    let script = "<script>
        const canvas = document.getElementById('canvas'), slider = document.getElementById('pose');
        const said = () => document.getElementById('view-status').textContent;
        const press = key => canvas.dispatchEvent(new KeyboardEvent('keydown', { key, cancelable: true }));
        const heard = [];
        press('PageDown'); heard.push(said());
        slider.value = 9; slider.dispatchEvent(new Event('input')); heard.push(said());
        press('PageDown'); heard.push(said());
        press('0');
        const before = canvas.toDataURL(); press('ArrowLeft'); heard.push(String(before !== canvas.toDataURL()));
        const turned = canvas.toDataURL(); press('+'); heard.push(String(turned !== canvas.toDataURL()));
        press('0'); heard.push(String(before === canvas.toDataURL()));
        document.body.dataset.heard = heard.join(' | ');
    </script></body>";
    let Some((dom, log)) = in_browser("keys", &page.replace("</body>", script)) else {
        skipped_tests::skip(skipped_tests::NO_BROWSER);
        return;
    };
    assert!(!log.contains("CONSOLE"), "{log}");
    let heard = dom
        .split("data-heard=\"")
        .nth(1)
        .and_then(|rest| rest.split('"').next())
        .expect("the script ran");
    let told: Vec<&str> = heard.split(" | ").collect();
    assert!(
        told[0].starts_with("Pose 2 of 10: check 1, error "),
        "{heard}"
    );
    assert!(
        told[1].starts_with("Pose 10 of 10") && told[2] == told[1],
        "{heard}"
    );
    assert_eq!(told[3..], ["true", "true", "true"], "{heard}");
}

/// The page as Chromium builds it, with what it said on the console; `None` when no browser is installed.
fn in_browser(name: &str, text: &str) -> Option<(String, String)> {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("page-{name}"));
    std::fs::create_dir_all(&folder).expect("a folder");
    let page = folder.join("report.html");
    std::fs::write(&page, text).expect("a file");
    for browser in ["chromium", "chromium-browser", "google-chrome"] {
        let out = Command::new(browser)
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-quic",
                "--no-first-run",
                "--disable-background-networking",
            ])
            .args([
                "--disable-component-update",
                "--disable-sync",
                "--enable-logging=stderr",
                "--dump-dom",
                "--virtual-time-budget=2000",
            ])
            .arg(format!(
                "--user-data-dir={}",
                folder.join("profile").display()
            ))
            .arg(format!("file://{}", page.display()))
            .output();
        if let Ok(out) = out {
            return Some((
                String::from_utf8_lossy(&out.stdout).into_owned(),
                String::from_utf8_lossy(&out.stderr).into_owned(),
            ));
        }
    }
    None
}

#[test]
fn a_browser_finds_the_answers_by_their_headings() {
    for (name, report, text) in pages() {
        let Some((dom, log)) = in_browser(name, &text) else {
            skipped_tests::skip(skipped_tests::NO_BROWSER);
            return;
        };
        let console: Vec<&str> = log
            .lines()
            .filter(|line| line.contains("CONSOLE"))
            .collect();
        assert!(console.is_empty(), "{name}: {console:?}");
        for answer in answers(&report) {
            let heading = format!("<h2 id=\"{}\">{}</h2>", answer.id, answer.question);
            let after = dom
                .split(&heading)
                .nth(1)
                .unwrap_or_else(|| panic!("{name}: no heading {heading}"));
            let part = after.split("</section>").next().unwrap_or("");
            assert_eq!(
                part.matches("<p>").count(),
                answer.lines.len(),
                "{name}: {}",
                answer.id
            );
        }
        if name == "accepted" {
            assert!(
                dom.contains("data-ready=\"yes\""),
                "the 3-D view did not start"
            );
            assert!(
                dom.contains("Pose 1 of 10: check 7"),
                "the view does not begin with the worst pose"
            );
        }
    }
}

/// The sizes at which the page is judged: a laptop's window and a telephone's.
const SIZES: [[u32; 2]; 2] = [[1280, 800], [400, 800]];

#[test]
fn the_first_screen_shows_or_leads_to_every_answer() {
    for (name, report, text) in pages() {
        let answers = answers(&report);
        let ids: Vec<&str> = answers.iter().map(|answer| answer.id).collect();
        for size in SIZES {
            let Some(seen) = browser::open(name, &text, size, &browser::first_screen(&ids)) else {
                skipped_tests::skip(skipped_tests::NO_BROWSER);
                return;
            };
            let at = format!("{name} at {size:?}: {}", seen.told);
            assert!(seen.console.is_empty(), "{at}: {:?}", seen.console);
            assert!(seen.hosts.is_empty(), "{at}: {:?}", seen.hosts);
            assert_eq!(seen.told["wide"], size[0], "{at}");
            assert_eq!(seen.told["loaded"], 0, "the page loaded something: {at}");
            assert_eq!(seen.told["overflow"], 0, "wider than the screen: {at}");
            for id in &ids {
                let how = &seen.told["answers"][id];
                // Below the verdict, the number and the warnings there is room for some; a link leads to each other.
                assert!(how == "seen" || how == "linked", "{id} is {how}: {at}");
            }
        }
    }
}

#[test]
fn every_layer_draws_something_and_errors_grow_with_their_slider() {
    let page = html(&examples::accepted(), Some(&examples::view())).expect("a page");
    let script = "
        const canvas = document.getElementById('canvas'), factor = document.getElementById('factor');
        const picture = () => canvas.toDataURL();
        const told = { still: {}, factor: null, grows: false, hidden: document.getElementById('still').hidden };
        for (const box of document.querySelectorAll('#layers input')) {
            const before = picture();
            box.click();
            const name = box.parentElement.textContent.trim();
            told.still[name] = before === picture();
            box.click();
            if (before !== picture()) told.still[name] = 'does not come back';
        }
        const before = picture();
        factor.value = 3; factor.dispatchEvent(new Event('input'));
        told.factor = document.getElementById('factor-text').textContent;
        told.grows = before !== picture();
        return told;";
    let Some(seen) = browser::open("layers", &page, SIZES[0], script) else {
        skipped_tests::skip(skipped_tests::NO_BROWSER);
        return;
    };
    assert!(seen.console.is_empty(), "{:?}", seen.console);
    let layers = seen.told["still"].as_object().expect("layers");
    assert_eq!(layers.len(), 8, "{}", seen.told);
    assert!(
        layers.values().all(|still| still == false),
        "a layer without a picture: {}",
        seen.told
    );
    assert_eq!(seen.told["factor"], "1000");
    assert_eq!(seen.told["grows"], true);
    assert_eq!(seen.told["hidden"], true, "the still picture gives way");
}

#[test]
fn what_exceeds_the_error_is_not_called_a_part_of_it() {
    let mut report = examples::accepted();
    let said = |report: &Report| {
        let page = html(report, None).expect("a page");
        [
            page.contains("Of this: "),
            page.contains("The fit expects more: "),
        ]
    };
    assert_eq!(said(&report), [true, false]);
    report.accuracy_limits[0].sigma_m = Some(0.05);
    assert_eq!(said(&report), [false, true]);
}
