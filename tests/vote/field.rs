//! The vote on built clouds: the winners, the labels of unseen Gaussians, the segments that are one part, and the
//! errors for bad input.

use gprop::camera::Camera;
use gprop::gaussians::Gaussians;
use gprop::materials::MaterialLibrary;
use gprop::pictures::field_colors;
use gprop::query::{Answer, Answers, Failure, Form, Inside, Outcome, SubjectAnswer, SubjectId};
use gprop::render::{RenderOptions, render, render_labels};
use gprop::segment::LabelMap;
use gprop::units::{Estimate, Range, ShoreHardness, ShoreScale};
use gprop::vote::{
    Agreement, AnsweredPart, Contents, FieldPart, MaterialField, Options, Rule, VoteError, VotingView, field_ply, vote,
    vote_on_parts,
};
use gprop::words::progress::Progress;

use super::build::{Blob, answer, camera_at, cloud};
use crate::support::changed;

/// Three materials of the library.
const ROWS: [usize; 3] = [0, 1, 2];

/// A wall in the plane y = `y`, 2 wide and 1 high, of overlapping blobs.
fn wall(y: f32) -> Vec<Blob> {
    let place = |n: usize, count: usize, length: f32| (n as f32 + 0.5) / count as f32 * length - 0.5 * length;
    (0..32 * 16)
        .map(|n| Blob {
            scale: [0.04, 0.01, 0.04],
            ..Blob::round([place(n % 32, 32, 2.0), y, place(n / 32, 16, 1.0)], 0.04, 0.95)
        })
        .collect()
}

/// The input of a vote: views with their maps, and their answers.
#[derive(Default)]
struct Ballot {
    views: Vec<(String, Camera, LabelMap)>,
    answers: Answers,
}

impl Ballot {
    /// Adds a view whose map is what it would see if Gaussian `i` had label `labels[i]` (0: background).
    fn view(&mut self, gaussians: &Gaussians, eye: [f64; 3], labels: &[u32]) -> &mut Self {
        let camera = camera_at(eye, [0.0; 3]);
        let seen = render_labels(gaussians, &camera, labels, &Default::default());
        let labels = seen.into_iter().map(|label| label.unwrap_or(0) as u16).collect();
        let map = LabelMap { width: camera.intrinsics.width, height: camera.intrinsics.height, labels };
        self.views.push((format!("view{}", self.views.len()), camera, map));
        self
    }

    /// Adds an answer for a segment of the last view.
    fn says(&mut self, segment: u16, answer: Answer) -> &mut Self {
        self.outcome(segment, Outcome::Answered(answer))
    }

    fn outcome(&mut self, segment: u16, outcome: Outcome) -> &mut Self {
        let view = self.views.last().unwrap().0.clone();
        self.answers.all.push(SubjectAnswer { view, subject: SubjectId::Segment(segment), outcome });
        self
    }

    fn inputs(&self) -> Vec<VotingView<'_>> {
        self.views.iter().map(|(name, camera, map)| VotingView { name, camera, map }).collect()
    }

    fn count(&self, gaussians: &Gaussians, options: &Options) -> Result<MaterialField, VoteError> {
        vote(gaussians, &self.inputs(), &self.answers, MaterialLibrary::builtin(), options, Progress::HIDDEN)
    }
}

/// Directions around the front of the wall at y = 0.
fn front(n: usize) -> [f64; 3] {
    [-0.8 + 0.4 * n as f64, -3.0, 0.3 * (n % 2) as f64]
}

fn material_of(row: usize) -> &'static str {
    &MaterialLibrary::builtin().materials()[row].name
}

fn labels_by(gaussians: &Gaussians, label: impl Fn([f32; 3]) -> u32) -> Vec<u32> {
    gaussians.positions.iter().map(|&p| label(p)).collect()
}

const BOTH_RULES: [Rule; 2] = [Rule::Frequency, Rule::Contribution];

#[test]
fn the_majority_of_the_views_wins_and_confidence_says_by_how_much() {
    let gaussians = cloud(&wall(0.0));
    let whole = vec![1; gaussians.len()];
    let mut ballot = Ballot::default();
    for (n, row) in [0, 1, 0].into_iter().enumerate() {
        ballot.view(&gaussians, front(n), &whole).says(1, answer("wall", ROWS[row]));
    }
    // Each Gaussian for itself, as in the paper: all three views see it, two say material 0.
    let options = Options { vote: Rule::Frequency, agree: Agreement::Gaussian, ..Default::default() };
    let field = ballot.count(&gaussians, &options).unwrap();
    assert_eq!(field.parts.len(), 1);
    assert_eq!(field.parts[0].material, material_of(0));
    assert!(field.views.iter().all(|&views| views == 3));
    assert!(field.votes.iter().all(|&votes| votes == 2.0));
    assert!(field.confidence.iter().all(|c| (c - 2.0 / 3.0).abs() < 1e-6));
    // The views agree first: all three then vote for material 0, but one of three answers named another.
    let field = ballot.count(&gaussians, &Options { vote: Rule::Frequency, ..Default::default() }).unwrap();
    assert_eq!(field.parts[0].material, material_of(0));
    assert!(field.votes.iter().all(|&votes| votes == 3.0));
    assert!(field.confidence.iter().all(|c| (c - 2.0 / 3.0).abs() < 1e-6), "{:?}", field.confidence);
}

#[test]
fn a_single_view_decides_alone() {
    let gaussians = cloud(&wall(0.0));
    let mut ballot = Ballot::default();
    ballot.view(&gaussians, front(2), &vec![1; gaussians.len()]).says(1, answer("wall", 0));
    let field = ballot.count(&gaussians, &Options::default()).unwrap();
    assert!(field.part_index.iter().all(|&label| label == 0) && field.views.iter().all(|&views| views == 1));
}

#[test]
fn unanimous_views_give_a_confidence_of_exactly_one() {
    let gaussians = cloud(&wall(0.0));
    let mut ballot = Ballot::default();
    for n in 0..5 {
        ballot.view(&gaussians, front(n), &vec![1; gaussians.len()]).says(1, answer("wall", 0));
    }
    let field = ballot.count(&gaussians, &Options::default()).unwrap();
    assert!(field.confidence.iter().all(|&confidence| confidence == 1.0), "{:?}", field.confidence);
}

#[test]
fn a_segment_on_no_gaussian_is_named() {
    let gaussians = cloud(&wall(0.0));
    let mut ballot = Ballot::default();
    ballot.view(&gaussians, front(2), &vec![1; gaussians.len()]).says(1, answer("wall", 0)).says(2, answer("ghost", 1));
    // The picture's first row shows nothing of the wall.
    let map = &mut ballot.views[0].2;
    let width = map.width as usize;
    map.labels[..width].fill(2);
    for rule in BOTH_RULES {
        let field = ballot.count(&gaussians, &Options { vote: rule, ..Default::default() }).unwrap();
        assert_eq!(field.parts.len(), 1);
        assert_eq!(
            field.notes,
            [
                "the answer about part or segment 2 in view `view0` (ghost) does not count: the splat shows nothing there"
            ]
        );
    }
}

#[test]
fn a_tie_goes_to_the_surer_answers_then_to_the_first_name() {
    let gaussians = cloud(&wall(0.0));
    let whole = vec![1; gaussians.len()];
    let options = Options { vote: Rule::Frequency, ..Default::default() };
    let winner = |confidence: [f64; 2]| {
        let mut ballot = Ballot::default();
        for n in 0..2 {
            let answer = changed(answer("wall", ROWS[n]), |answer| answer.confidence = confidence[n]);
            ballot.view(&gaussians, [0.0, -3.0, 0.0], &whole).says(1, answer);
        }
        ballot.count(&gaussians, &options).unwrap().parts[0].material.clone()
    };
    assert_eq!(winner([0.4, 0.9]), material_of(1));
    assert_eq!(winner([0.9, 0.4]), material_of(0));
    assert_eq!(winner([0.5, 0.5]), material_of(0).min(material_of(1)));
}

#[test]
fn what_a_wall_hides_takes_no_vote_through_it() {
    // Two walls 0.2 apart, one seen from the front only, the other from behind only, and a third layer between them.
    let mut blobs = wall(-0.1);
    blobs.extend(wall(0.1));
    blobs.extend(wall(-0.05));
    let gaussians = cloud(&blobs);
    let layer = |i: usize| i / (32 * 16);
    let labels: Vec<u32> = (0..gaussians.len()).map(|i| if layer(i) == 1 { 2 } else { 1 }).collect();
    for rule in BOTH_RULES {
        let mut ballot = Ballot::default();
        ballot.view(&gaussians, [0.0, -3.0, 0.0], &labels).says(1, answer("front", 0));
        ballot.view(&gaussians, [0.0, 3.0, 0.0], &labels).says(2, answer("back", 1));
        let field = ballot.count(&gaussians, &Options { vote: rule, ..Default::default() }).unwrap();
        let material = |i: usize| field.parts[field.part_index[i] as usize].material.as_str();
        // Away from the rim, where the views look past the walls' edges.
        let inner = |i: &usize| gaussians.positions[*i][0].abs() < 0.7 && gaussians.positions[*i][2].abs() < 0.3;
        for i in (0..gaussians.len()).filter(inner) {
            let (expected, hidden) = [(0, false), (1, false), (0, true)][layer(i)];
            assert_eq!(material(i), material_of(expected), "{rule:?}: Gaussian {i} of layer {}", layer(i));
            assert_eq!(field.views[i] == 0, hidden, "{rule:?}: Gaussian {i} of layer {}", layer(i));
            assert_eq!(field.confidence[i] == 0.0, hidden);
        }
    }
}

#[test]
fn one_part_under_three_numbers_is_one_label() {
    let gaussians = cloud(&wall(0.0));
    for rule in BOTH_RULES {
        let mut ballot = Ballot::default();
        for n in 0..3 {
            let (left, right) = (n as u32 + 1, n as u32 + 5);
            let labels = labels_by(&gaussians, |[x, ..]| if x < 0.0 { left } else { right });
            ballot.view(&gaussians, front(n), &labels);
            // One view gives a different material for the left half.
            ballot.says(left as u16, answer("left", if n == 1 { 2 } else { 0 })).says(right as u16, answer("right", 1));
        }
        let field = ballot.count(&gaussians, &Options { vote: rule, ..Default::default() }).unwrap();
        let mut materials: Vec<_> = field.parts.iter().map(|label| label.material.as_str()).collect();
        materials.sort_unstable();
        let mut expected = [material_of(0), material_of(1)];
        expected.sort_unstable();
        assert_eq!(materials, expected, "{rule:?}");
        assert!(field.confidence.iter().all(|confidence| (0.0..=1.0).contains(confidence)), "{rule:?}");
        // A pixel is 0.06 wide; nearer to the border than that, either half may own it.
        for (i, [x, ..]) in gaussians.positions.iter().enumerate().filter(|(_, p)| p[0].abs() > 0.06) {
            let expected = material_of(usize::from(*x >= 0.0));
            assert_eq!(field.parts[field.part_index[i] as usize].material, expected, "{rule:?}: x = {x}");
        }
    }
}

#[test]
fn touching_parts_of_one_material_stay_two_although_a_view_took_them_for_one() {
    let gaussians = cloud(&wall(0.0));
    let halves = labels_by(&gaussians, |[x, ..]| if x < 0.0 { 1 } else { 2 });
    let mut ballot = Ballot::default();
    for n in 0..4 {
        ballot.view(&gaussians, front(n), &halves).says(1, answer("left door", 0)).says(2, answer("right door", 0));
    }
    ballot.view(&gaussians, front(4), &vec![1; gaussians.len()]).says(1, answer("doors", 0));
    let field = ballot.count(&gaussians, &Options::default()).unwrap();
    assert_eq!(field.parts.len(), 2, "{:?}", field.parts);
    assert_ne!(field.part_index[0], field.part_index[31]);
}

#[test]
fn a_part_cut_finer_in_some_views_is_one_label() {
    let gaussians = cloud(&wall(0.0));
    let thirds = labels_by(&gaussians, |[x, ..]| if x < 0.3 { 1 } else { 2 });
    let mut ballot = Ballot::default();
    for n in 0..5 {
        if n % 2 == 0 {
            ballot.view(&gaussians, front(n), &vec![1; gaussians.len()]).says(1, answer("board", 0));
        } else {
            ballot.view(&gaussians, front(n), &thirds).says(1, answer("board", 0)).says(2, answer("end", 0));
        }
    }
    let field = ballot.count(&gaussians, &Options::default()).unwrap();
    assert_eq!(field.parts.len(), 1, "{:?}", field.parts);
}

#[test]
fn numbers_come_from_the_winning_answers_alone() {
    let gaussians = cloud(&wall(0.0));
    let whole = vec![1; gaussians.len()];
    let mut ballot = Ballot::default();
    let shore = |low, high| Some(ShoreHardness { scale: ShoreScale::A, range: Range::new(low, high) });
    let wall_of = |low, high| Form::Shell { wall_thickness_m: Range::new(low, high) };
    let winning = [
        (Range::new(500.0, 700.0), shore(40.0, 50.0), Form::Solid),
        (Range::new(600.0, 1000.0), shore(45.0, 70.0), wall_of(0.001, 0.002)),
        (Range::new(610.0, 630.0), None, wall_of(0.003, 0.004)),
    ];
    for (n, (density_kg_m3, hardness, form)) in winning.into_iter().enumerate() {
        let answer = changed(answer("wall", 0), |answer| {
            (answer.density_kg_m3, answer.hardness, answer.form) = (density_kg_m3, hardness, form);
        });
        ballot.view(&gaussians, front(n), &whole).says(1, answer);
    }
    let odd = changed(answer("wall", 1), |answer| answer.density_kg_m3 = Range::new(7800.0, 7900.0));
    ballot.view(&gaussians, front(3), &whole).says(1, odd);
    let label = &ballot.count(&gaussians, &Options::default()).unwrap().parts[0];
    // Middles 600, 800 and 620; the hull of the three ranges.
    assert_eq!((label.density_kg_m3.low, label.density_kg_m3.mid, label.density_kg_m3.high), (500.0, 620.0, 1000.0));
    assert_eq!(label.hardness, shore(40.0, 70.0));
    assert_eq!(label.form, wall_of(0.001, 0.002));
    assert_eq!(label.law, MaterialLibrary::builtin().get(material_of(0)).unwrap().law);
}

/// The label of a wall about which views say these things.
fn label_of(answers: Vec<Answer>) -> FieldPart {
    let gaussians = cloud(&wall(0.0));
    let whole = vec![1; gaussians.len()];
    let mut ballot = Ballot::default();
    for (n, answer) in answers.into_iter().enumerate() {
        ballot.view(&gaussians, front(n), &whole).says(1, answer);
    }
    ballot.count(&gaussians, &Options::default()).unwrap().parts.remove(0)
}

#[test]
fn what_is_inside_is_what_most_answers_say() {
    let form = Form::Shell { wall_thickness_m: Range::new(0.001, 0.002) };
    let says = |inside| changed(answer("wall", 0), |answer| (answer.form, answer.inside) = (form, Some(inside)));
    let full = |filling: &str, low| {
        says(Inside::Filled { filling: filling.to_owned(), share: Range::new(low, 1.0), density_kg_m3: None })
    };
    let contents = |answers: Vec<Answer>| label_of(answers).inside.unwrap();

    let Contents::Filled(filled) = contents(vec![full("sugar", 0.8), full("salt", 0.9), full("salt", 0.7)]) else {
        panic!("all say that it is full")
    };
    let library = MaterialLibrary::builtin();
    let (sugar, salt) = (library.filling("sugar").unwrap(), library.filling("salt").unwrap());
    assert_eq!((filled.filling.as_str(), filled.law), ("salt", salt.law));
    assert_eq!((filled.share.low, filled.share.high), (0.7, 1.0));
    assert_eq!(
        (filled.density_kg_m3.low, filled.density_kg_m3.high),
        (sugar.density_kg_m3.low, salt.density_kg_m3.high)
    );
    assert_eq!(filled.density_kg_m3.mid, salt.density_kg_m3.mid());

    assert_eq!(contents(vec![says(Inside::Empty), says(Inside::Empty), full("salt", 0.9)]), Contents::Empty);
    assert_eq!(contents(vec![says(Inside::Empty), full("salt", 0.9)]), Contents::Unknown);
    assert_eq!(contents(vec![says(Inside::Unknown)]), Contents::Unknown);
    assert_eq!(label_of(vec![answer("wall", 0)]).inside, None, "a solid has no inside");
}

#[test]
fn a_mixed_part_takes_its_density_from_the_answers_that_give_the_whole() {
    let bulk = Range::new(900.0, 1500.0);
    let reason = || Some("a motor in its housing".to_owned());
    let mixed = || {
        changed(answer("wall", 0), |answer| {
            (answer.form, answer.density_kg_m3, answer.bulk_reason) = (Form::Mixed, bulk, reason());
        })
    };
    let label = label_of(vec![answer("wall", 0), mixed(), mixed()]);
    assert_eq!((label.form, label.bulk_reason), (Form::Mixed, reason()));
    assert_eq!(label.density_kg_m3, Estimate::from(bulk));
    let label = label_of(vec![answer("wall", 0), mixed()]);
    assert_eq!((label.form, label.bulk_reason), (Form::Solid, None), "solid, if as many say either");
    assert_eq!(label.density_kg_m3, Estimate::from(answer("wall", 0).density_kg_m3));
}

#[test]
fn failed_answers_cast_no_votes_and_are_counted() {
    let gaussians = cloud(&wall(0.0));
    let halves = labels_by(&gaussians, |[x, ..]| if x < 0.0 { 1 } else { 2 });
    let failure = || Outcome::Failed(Failure::Refused { message: "no".to_owned() });
    let mut ballot = Ballot::default();
    ballot.view(&gaussians, front(0), &halves).says(1, answer("left", 0)).outcome(2, failure());
    ballot.view(&gaussians, front(1), &halves).says(1, answer("left", 0)).says(2, answer("right", 1));
    ballot.view(&gaussians, front(2), &vec![0; gaussians.len()]);
    let field = ballot.count(&gaussians, &Options::default()).unwrap();
    assert_eq!(field.parts[field.part_index[31] as usize].material, material_of(1));
    assert_eq!((field.views[0], field.views[31]), (2, 1));
    let said = field.warnings.join("\n");
    assert!(said.contains("1 of 4 segments has no answer") && said.contains("view0/2"), "{said}");
    assert!(said.contains("`view2` shows no segments"), "{said}");

    let mut silent = Ballot::default();
    silent.view(&gaussians, front(0), &halves).outcome(1, failure()).outcome(2, failure());
    let error = silent.count(&gaussians, &Options::default()).unwrap_err();
    assert!(matches!(error, VoteError::NoVotes { views: 1, segments: 2, answered: 0 }), "{error}");
}

#[test]
fn a_segment_without_an_answer_takes_its_neighbours_material_unseen() {
    let gaussians = cloud(&wall(0.0));
    let halves = labels_by(&gaussians, |[x, ..]| if x < 0.0 { 1 } else { 2 });
    for rule in BOTH_RULES {
        let mut ballot = Ballot::default();
        for n in 0..3 {
            let failure = Outcome::Failed(Failure::Invalid { message: "no JSON".to_owned() });
            ballot.view(&gaussians, front(n), &halves).says(1, answer("left", 0)).outcome(2, failure);
        }
        let field = ballot.count(&gaussians, &Options { vote: rule, ..Default::default() }).unwrap();
        let last = 31;
        assert!(gaussians.positions[last][0] > 0.5);
        assert_eq!(field.parts[field.part_index[last] as usize].material, material_of(0));
        assert_eq!((field.views[last], field.votes[last], field.confidence[last]), (0, 0.0, 0.0), "{rule:?}");
        assert!(field.views[0] > 0);
        let said = field.warnings.join("\n");
        assert!(said.contains("3 of 6 segments have no answer, so what they show takes the material around it: view0/2, view1/2, view2/2"), "{said}");
    }
}

/// The sum of two covariances has no inverse if both Gaussians lie in one plane and have no thickness: the square of
/// exp(-400) is 0.
#[test]
fn among_gaussians_without_thickness_the_nearest_decide_for_an_unseen_one() {
    let mut blobs = wall(0.0);
    // Two rows above the border between the materials; of its 32 nearest, the first are all below the border.
    let unseen = 9 * 32 + 16;
    blobs[unseen].opacity = 1e-4;
    let mut gaussians = cloud(&blobs);
    gaussians.log_scales.iter_mut().for_each(|axes| axes[1] = -400.0);
    let halves = labels_by(&gaussians, |[.., z]| if z < 0.0 { 1 } else { 2 });
    let mut ballot = Ballot::default();
    ballot.view(&gaussians, front(2), &halves).says(1, answer("lower", 0)).says(2, answer("upper", 1));
    let field = ballot.count(&gaussians, &Options::default()).unwrap();
    assert_eq!(field.views[unseen], 0);
    assert_eq!(field.parts[field.part_index[unseen] as usize].material, material_of(1));
}

#[test]
fn bad_input_is_refused_by_name() {
    let gaussians = cloud(&wall(0.0));
    let whole = vec![1; gaussians.len()];
    let mut ballot = Ballot::default();
    ballot
        .view(&gaussians, front(0), &whole)
        .says(1, changed(answer("wall", 0), |answer| answer.material = "unobtainium".into()));
    let error = ballot.count(&gaussians, &Options::default()).unwrap_err().to_string();
    assert!(error.contains("`unobtainium`") && error.contains("segment 1 of view `view0`"), "{error}");

    ballot.views[0].2.width -= 1;
    let error = ballot.count(&gaussians, &Options::default()).unwrap_err().to_string();
    assert!(error.contains("view0") && error.contains("63") && error.contains("64"), "{error}");

    let error = Ballot::default().count(&Gaussians::default(), &Options::default()).unwrap_err();
    assert!(matches!(error, VoteError::NoGaussians));
}

#[test]
fn an_unknown_material_in_any_answer_about_a_part_is_refused_by_name() {
    let gaussians = cloud(&wall(0.0));
    let mut ballot = Ballot::default();
    ballot.view(&gaussians, front(2), &vec![1; gaussians.len()]);
    let known = answer("wall", 0);
    let unknown = changed(known.clone(), |answer| answer.material = "unobtainium".into());
    let (views, library, options) = (ballot.inputs(), MaterialLibrary::builtin(), Options::default());
    // The unknown material is in the part's lesser answers, which win together; then also in its main answer.
    for pixels in [[10.0, 7.0, 7.0], [1.0, 7.0, 7.0]] {
        let answers = [(1, &known, pixels[0]), (1, &unknown, pixels[1]), (1, &unknown, pixels[2])];
        let parts = AnsweredPart::collect(answers);
        let error = vote_on_parts(&gaussians, &views, &parts, library, &options, Progress::HIDDEN).unwrap_err();
        assert!(matches!(error, VoteError::UnknownMaterial { .. }), "{error}");
        assert!(error.to_string().contains("part 1 names `unobtainium`"), "{error}");
    }
}

/// The questions, and the people who read them, know a part by this id.
#[test]
fn a_part_keeps_the_id_under_which_it_was_asked_about() {
    let gaussians = cloud(&wall(0.0));
    // More Gaussians belong to part 9, and none to part 2.
    let ids = labels_by(&gaussians, |[x, ..]| if x < -0.3 { 4 } else { 9 });
    let mut ballot = Ballot::default();
    ballot.view(&gaussians, front(2), &ids);
    let (end, board, pin) = (answer("end", 0), answer("board", 1), answer("pin", 2));
    let parts = AnsweredPart::collect([(9, &board, 9.0), (4, &end, 4.0), (2, &pin, 1.0)]);
    let (views, library, options) = (ballot.inputs(), MaterialLibrary::builtin(), Options::default());
    let field = vote_on_parts(&gaussians, &views, &parts, library, &options, Progress::HIDDEN).unwrap();
    let named: Vec<(u32, &str)> = field.parts.iter().map(|label| (label.id, label.caption.as_str())).collect();
    assert_eq!(named, [(4, "end"), (9, "board")]);
    let found: Vec<u32> = field.part_ids().collect();
    assert_eq!((found[0], found[31]), (4, 9));
    let columns = field_ply::columns(&field);
    assert!(columns[0].values.iter().zip(&found).all(|(column, id)| *column == *id as f32));
    assert_eq!(field_ply::read(&columns, field.parts.clone()).unwrap(), field);
}

#[test]
fn strange_gaussians_and_a_camera_inside_do_no_harm() {
    let mut blobs = wall(0.0);
    blobs.extend(wall(0.3));
    blobs.push(Blob::round([0.0, 0.1, 0.0], 0.05, 1e-4));
    blobs.push(Blob::round([0.0, 0.1, 0.0], 0.05, 0.0));
    blobs.push(Blob::round([0.0, 0.1, 0.0], 1e5, 0.5));
    let gaussians = cloud(&blobs);
    let labels = labels_by(&gaussians, |_| 1);
    let mut ballot = Ballot::default();
    ballot.view(&gaussians, front(2), &labels).says(1, answer("wall", 0));
    ballot.view(&gaussians, [0.0, 0.15, 0.01], &labels).says(1, answer("wall", 0));
    for rule in BOTH_RULES {
        let field = ballot.count(&gaussians, &Options { vote: rule, ..Default::default() }).unwrap();
        assert!(field.part_index.iter().all(|&label| label == 0));
        let faint = [field.views[blobs.len() - 3], field.views[blobs.len() - 2]];
        assert_eq!(faint, [0, 0], "what is too faint to be drawn is not seen");
        let noted = field.notes.join("\n");
        assert!(noted.contains("2 Gaussians are too faint to be drawn"), "{noted}");
        assert!(noted.contains("1 Gaussian is larger than the object"), "{noted}");
        let said = field.warnings.join("\n");
        assert!(said.contains("camera of view `view1` stands inside the object"), "{said}");
    }
}

#[test]
fn the_field_does_not_depend_on_the_number_of_threads() {
    let gaussians = cloud(&wall(0.0));
    let halves = labels_by(&gaussians, |[x, _, z]| if x + 0.3 * z < 0.0 { 1 } else { 2 });
    let mut ballot = Ballot::default();
    for n in 0..4 {
        ballot.view(&gaussians, front(n), &halves).says(1, answer("left", n % 3)).says(2, answer("right", 1));
    }
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| ballot.count(&gaussians, &Options::default()).unwrap())
    };
    assert_eq!(on(1), on(2));
}

#[test]
fn the_columns_of_the_ply_hold_the_field() {
    let gaussians = cloud(&wall(0.0));
    let halves = labels_by(&gaussians, |[x, ..]| if x < 0.1 { 1 } else { 2 });
    let mut ballot = Ballot::default();
    ballot.view(&gaussians, front(2), &halves).says(1, answer("left", 1)).says(2, answer("right", 0));
    let field = ballot.count(&gaussians, &Options::default()).unwrap();
    let columns = field_ply::columns(&field);
    let names: Vec<_> = columns.iter().map(|column| column.name.as_str()).collect();
    let expected = "part_label material_id density E nu yield_stress friction hardness conf votes views";
    assert_eq!(names.join(" "), expected);
    assert!(columns.iter().all(|column| column.values.len() == gaussians.len()));

    let materials = field_ply::materials(&field.parts, MaterialLibrary::builtin());
    for i in 0..gaussians.len() {
        let label = &field.parts[field.part_index[i] as usize];
        assert_eq!(materials[columns[1].values[i] as usize].name, label.material);
        assert_eq!(columns[2].values[i], label.density_kg_m3.mid as f32);
        assert_eq!(columns[3].values[i], label.youngs_modulus_pa.mid as f32);
    }
    // Two materials, two colours, the same from every side.
    let colors = field_colors::material_colors(&field);
    let recolored = field_colors::recolored(&gaussians, &colors);
    assert_eq!((recolored.sh_degree, recolored.sh_rest.len()), (0, 0));
    let options = RenderOptions::default();
    let picture = render(&recolored, &camera_at([0.0, -3.0, 0.0], [0.0; 3]), &options);
    for (pixel, i) in [(24 * 64 + 28, 0), (24 * 64 + 44, gaussians.len() - 1)] {
        for (drawn, expected) in picture.rgb[pixel].into_iter().zip(colors[i]) {
            assert!((drawn / picture.alpha[pixel] - expected).abs() < 1e-3, "pixel {pixel}: {drawn}, {expected}");
        }
    }
    assert_ne!(colors[0], colors[gaussians.len() - 1]);

    let mut file = Vec::new();
    gprop::scene::splat::ply::write(&mut file, &gaussians, &columns).unwrap();
    let reread = gprop::scene::splat::ply::parse(&file).unwrap().gaussians;
    assert_eq!(field_ply::read(&reread.extra, field.parts.clone()).unwrap(), field);
}
