//! Ways to spoil a good scene on disk, each with what has to be said of it.

pub mod draft;
mod images;
mod poses;
pub mod textured;

use draft::{Base, Draft};
use neat_core::LoadOptions;
use neat_doctor::{Cause, Check, Examination, ExamineOptions, Level, examine_folder};

/// Reads scenes without asking for 2D wireframes.
pub fn load_options() -> LoadOptions {
    LoadOptions {
        require_wireframes: false,
        ..LoadOptions::default()
    }
}

/// One way to spoil a scene.
pub struct Corruption {
    pub name: &'static str,
    expected: Expected,
    needs: Needs,
    spoil: fn(&mut Draft),
}

/// What has to be said.
enum Expected {
    /// A problem of this cause.
    Problem(Cause),
    /// A problem of this cause, which these flags repair.
    Repair(Cause, &'static str),
    /// A problem or a warning of this cause.
    Told(Cause),
    /// A warning of this check, and no problem: the scene can be used.
    Warning(Check),
}

/// What a scene must have to be spoilt this way.
#[derive(Clone, Copy, PartialEq)]
enum Needs {
    Nothing,
    /// Images that are not square.
    Oblong,
    Wireframes,
    /// More than nine views, whose numbers have one digit or two.
    TenViews,
}

impl Corruption {
    /// All of them.
    pub fn all() -> Vec<Self> {
        poses::table().into_iter().chain(images::table()).collect()
    }

    fn problem(name: &'static str, cause: Cause, spoil: fn(&mut Draft)) -> Self {
        let (expected, needs) = (Expected::Problem(cause), Needs::Nothing);
        Self {
            name,
            expected,
            needs,
            spoil,
        }
    }

    fn warning(name: &'static str, check: Check, spoil: fn(&mut Draft)) -> Self {
        let expected = Expected::Warning(check);
        Self {
            expected,
            ..Self::problem(name, Cause::Other, spoil)
        }
    }

    fn told(name: &'static str, cause: Cause, spoil: fn(&mut Draft)) -> Self {
        let expected = Expected::Told(cause);
        Self {
            expected,
            ..Self::problem(name, cause, spoil)
        }
    }

    fn repaired_by(mut self, flags: &'static str) -> Self {
        if let Expected::Problem(cause) = self.expected {
            self.expected = Expected::Repair(cause, flags);
        }
        self
    }

    fn needs(mut self, needs: Needs) -> Self {
        self.needs = needs;
        self
    }

    pub fn applies_to(&self, base: &Base) -> bool {
        let views = &base.scene.views;
        match self.needs {
            Needs::Nothing => true,
            Needs::Oblong => views[0].camera.width != views[0].camera.height,
            Needs::Wireframes => base.scene.has_wireframes(),
            Needs::TenViews => views.len() > 9,
        }
    }

    /// What is said of the base scene, spoilt.
    pub fn examined(&self, base: &Base) -> Examination {
        let mut draft = Draft::new(base);
        (self.spoil)(&mut draft);
        let dir = draft.write();
        examine_folder(dir.path(), &draft.load, &ExamineOptions::default())
    }

    /// Whether a warning is enough.
    #[allow(dead_code, reason = "the example counts them, the tests do not")]
    pub fn may_be_a_warning(&self) -> bool {
        matches!(self.expected, Expected::Warning(_) | Expected::Told(_))
    }

    /// What has to be said, in words.
    #[allow(dead_code, reason = "the example prints it, the tests do not")]
    pub fn expected(&self) -> String {
        match &self.expected {
            Expected::Problem(cause) => format!("{cause:?}"),
            Expected::Repair(cause, flags) => format!("{cause:?}, `{flags}`"),
            Expected::Told(cause) => format!("{cause:?}, at least a warning"),
            Expected::Warning(check) => format!("a warning: {check}"),
        }
    }

    /// Whether the first problem, or a warning where there is none, is the right one.
    pub fn judged(&self, examination: &Examination) -> Result<(), String> {
        let problem = examination.problems().next();
        let (cause, flags) = match (&self.expected, problem) {
            (Expected::Warning(check), None) => {
                let told = (examination.at(Level::Warning)).any(|f| f.check == *check);
                let silent = || format!("no such warning:\n{examination}");
                return told.then_some(()).ok_or_else(silent);
            }
            (Expected::Warning(_), Some(problem)) => {
                return Err(format!("no problem should be seen:\n{problem}"));
            }
            (Expected::Told(cause), None) => {
                let told = (examination.at(Level::Warning)).any(|f| f.cause == Some(*cause));
                let silent = || format!("no such warning:\n{examination}");
                return told.then_some(()).ok_or_else(silent);
            }
            (_, None) => return Err(format!("no problem found:\n{examination}")),
            (Expected::Problem(cause) | Expected::Told(cause), _) => (*cause, None),
            (Expected::Repair(cause, flags), _) => (*cause, Some(*flags)),
        };
        let problem = problem.expect("the match has ended where there is none");
        if problem.cause != Some(cause) {
            return Err(format!("another cause, {:?}:\n{problem}", problem.cause));
        }
        let given = problem.repair.map(|repair| repair.to_string());
        if flags.is_some() && given.as_deref() != flags {
            return Err(format!("other flags: {given:?}"));
        }
        Ok(())
    }
}
