//! The catching commands: one-line errors, and repeatable results.

use crate::command::{Lab, expect, json, stderr, stdout, tactnet};

fn series(more: &[&str]) -> std::process::Command {
    let mut series = tactnet(["catch", "throw-series", "--throws", "4", "--json"]);
    series.args(more);
    series
}

#[test]
fn a_series_is_the_same_for_any_number_of_cores_and_its_page_needs_no_network() {
    let lab = Lab::new();
    let page = lab.path("throws.html");
    let picture = lab.path("throw.svg");
    let mut whole = series(&["--page"]);
    whole.arg(&page).arg("--picture").arg(&picture);
    let whole = stdout(&expect(0, whole));
    let mut alone = series(&[]);
    alone.env("RAYON_NUM_THREADS", "1");
    assert_eq!(whole, stdout(&expect(0, alone)));
    let page = std::fs::read_to_string(page).unwrap();
    assert!(page.contains("<svg"), "{page}");
    for reference in ["http:", "https:", "://", " src=", "@import", "url("] {
        assert!(!page.contains(reference), "{reference}: {page}");
    }
    let picture = std::fs::read_to_string(picture).unwrap();
    assert!(picture.starts_with("<svg xmlns=") && picture.ends_with("</svg>\n"));
    assert!(picture.matches("<circle").count() > 10, "{picture}");
    assert!(
        page.contains(
            picture
                .rsplit_once("</style>")
                .unwrap()
                .1
                .split_once("/>")
                .unwrap()
                .1
                .trim_end_matches("</svg>\n")
        )
    );
    let report: serde_json::Value = serde_json::from_str(&whole).unwrap();
    assert_eq!(report["throws"], 4);
    assert!(report["caught"].as_u64() <= report["in_catch_space"].as_u64());
}

/// Returns a stand-alone picture without its frame.
fn content(path: &std::path::Path) -> String {
    let picture = std::fs::read_to_string(path).unwrap();
    let (_, content) = picture.split_once("height=\"100%\"/>").unwrap();
    content.trim().trim_end_matches("</svg>").to_string()
}

#[test]
fn each_mode_moves_the_robot_differently_and_the_picture_of_the_modes_shows_all() {
    let lab = Lab::new();
    let [all, ramps, fingers] =
        ["modes.svg", "ramps.svg", "fingers.svg"].map(|name| lab.path(name));
    let mut pictures = Vec::new();
    for mode in ["soft", "latest", "cool"] {
        let picture = lab.path(mode);
        let mut one = tactnet(["catch", "throw-series", "--throws", "1", "--seed", "11"]);
        one.args(["--json", "--mode", mode]);
        one.arg("--picture").arg(&picture);
        if mode == "soft" {
            one.arg("--modes-picture").arg(&all);
            one.arg("--ramps-picture").arg(&ramps);
            one.arg("--fingers-picture").arg(&fingers);
        }
        assert_eq!(json(one)["mode"], mode);
        pictures.push(content(&picture));
    }
    let all = content(&all);
    let rows: Vec<&str> = all.split("<g transform=\"translate(0 ").skip(1).collect();
    assert_eq!(rows.len(), 3);
    for ((row, picture), mode) in rows.iter().zip(&pictures).zip(["soft", "latest", "cool"]) {
        assert!(row.contains(picture), "{mode}: another throw");
        assert!(row.contains(&format!(">{mode}, at ")), "{mode}");
        // Commanded and measured rates of seven joints.
        assert_eq!(row.matches("<polyline").count(), 14, "{mode}");
    }
    assert!(pictures[0] != pictures[1] && pictures[1] != pictures[2] && pictures[0] != pictures[2]);
    let ramps = content(&ramps);
    for label in [
        "arm, desired [rad/s]",
        "arm, measured [rad/s]",
        "torso [rad/s]",
        "head [rad/s]",
        "platform [m/s]",
    ] {
        assert_eq!(ramps.matches(label).count(), 1, "{label}");
    }
    // Desired and measured rates of 7 joints of the arm, 3 of the torso, 2 of the neck and the platform; a legend.
    assert_eq!(ramps.matches("<polyline").count(), 2 * (2 * 13));
    // Six close-ups, each with the palm, three visible fingers and the ball.
    let fingers = content(&fingers);
    assert_eq!(fingers.matches("<polyline").count(), 6 * 4);
    assert_eq!(fingers.matches("<circle").count(), 6);
}

#[test]
fn balls_in_a_row_are_counted_one_by_one_and_drawn_together() {
    let lab = Lab::new();
    let picture = lab.path("row.svg");
    let mut row = series(&["--in-a-row", "3", "--picture"]);
    row.arg(&picture);
    let report = json(row);
    // Four throws are rounded up to two rows.
    assert_eq!(
        (&report["throws"], &report["in_a_row"]),
        (&6.into(), &3.into())
    );
    let picture = content(&picture);
    assert!((1..=3).all(|ball| picture.contains(&format!(">ball {ball}, "))));
    let refused = stderr(&expect(2, series(&["--in-a-row", "3", "--watch"])));
    assert!(refused.contains("--watch"), "{refused}");
}

#[test]
fn the_detector_finds_most_balls() {
    let bench = tactnet(["bench", "catch-detect", "--throws", "1", "--json"]);
    let report = json(bench);
    let of = |how: &str, what: &str| report[how][what].as_f64().unwrap();
    assert!(of("search", "recall") > 0.5, "{report}");
    assert!(of("gated", "recall") >= of("search", "recall"), "{report}");
    assert!(of("gated", "centre_px_rms") < 0.5, "{report}");
}

#[test]
fn motions_that_the_monitor_lets_go_on_stay_apart_when_braked() {
    let safety = tactnet(["bench", "catch-safety", "--motions", "1000", "--json"]);
    let report = json(safety);
    assert_eq!(report["missed"], 0, "{report}");
    let count = |what: &str| report[what].as_u64().unwrap();
    assert!(
        count("go") > 500 && count("braked_in_vain") < count("free") / 5,
        "{report}"
    );
    let watched = stdout(&expect(0, series(&["--watch"])));
    let watched: serde_json::Value = serde_json::from_str(&watched).unwrap();
    assert!(watched["braked"].is_u64() && watched["braked_in_vain"].is_u64());
}

#[test]
fn wrong_robots_worlds_and_places_are_one_line_before_anything_is_thrown() {
    let lab = Lab::new();
    let write = |name: &str, text: &str| {
        let path = lab.path(name);
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let nominal = include_str!("../../catching/packets/src/robot.toml");
    let turned = nominal.replacen("range = [-0.5, 0.5]", "range = [0.5, -0.5]", 1);
    assert_ne!(turned, nominal);
    let robot = write("robot.toml", &turned);
    let unknown = write("unknown.json", r#"{"torso": {"stifness": "rigid"}}"#);
    let light = write("light.json", r#"{"ball": {"air": -1}}"#);
    let nowhere = lab.path("nowhere/page.html").display().to_string();
    let there = write("there.rrd", "");
    for (arguments, named) in [
        (["--robot", &robot], "range"),
        (["--world", &unknown], "stifness"),
        (["--world", &light], "ball.air"),
        (["--page", &nowhere], "nowhere"),
        (
            ["--view", &there],
            if cfg!(feature = "rerun") {
                "expected a new file"
            } else {
                "rerun"
            },
        ),
    ] {
        let said = stderr(&expect(2, series(&arguments)));
        assert!(
            said.contains(named) && said.trim().lines().count() == 1,
            "{said}"
        );
    }
}

#[test]
fn pages_without_a_folder_are_refused_before_anything_moves() {
    let lab = Lab::new();
    let nowhere = lab.path("nowhere/page.html").display().to_string();
    for command in [
        &["calibrate", "--simulate"][..],
        &["rally"],
        &["throw-series", "--obstacles"],
    ] {
        let mut catch = tactnet(["catch"]);
        catch.args(command).args(["--page", &nowhere]);
        let said = stderr(&expect(2, catch));
        assert!(
            said.contains("nowhere: no such folder") && said.trim().lines().count() == 1,
            "{said}"
        );
    }
}
