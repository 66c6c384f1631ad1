//! Views that agree with some of the others, and not with the rest: as when two reconstructions
//! were put together whose frames or units differ.

use crate::evidence::Evidence;
use crate::examination::{Cause, Check, Finding, Level, counted, listed, median};
use crate::pose_diagnosis::Diagnosis;

/// Two views agree that explain so many pieces of what they have in common …
const MIN_EXPLAINED: usize = 3;
/// … and such a share of them: with wrong cameras less than 5 % of corners and 15 % of tracks
/// are explained, as for all views together.
const MIN_SHARE: f64 = 0.15;
/// A group needs as many views as a track.
const MIN_GROUP: usize = 3;
/// So many views look more like one of another group than like any of their own: two groups
/// with a border between them have two, at least.
const MIN_LOST: usize = 2;
/// Tracks of a usual view, below which one without any says nothing.
const USUAL_TRACKS: f64 = 10.0;
/// Fewer than this share of the usual number are those of chance.
const FEW: f64 = 0.1;

impl Diagnosis<'_> {
    /// Views that have nothing to do with the others, alone or in a group of their own.
    pub fn views_apart(&self, trusted: &[bool]) -> Vec<Finding> {
        let mut findings = Vec::new();
        findings.extend(self.strangers());
        findings.extend(self.groups(trusted));
        findings
    }

    /// Photographs that show nothing of what the others do.
    fn strangers(&self) -> Option<Finding> {
        let Evidence::Tracks { .. } = self.evidence() else {
            return None;
        };
        let agreement = self.all_given();
        let views = &self.gathered.views;
        let tracks = |view: usize| agreement.per_view[view].total as f64;
        let usual = median(views.iter().map(|&view| tracks(view)));
        // A few happen between any two images.
        let is_alone =
            |view: usize| tracks(view) < FEW * usual && agreement.per_view[view].explained == 0;
        if usual < USUAL_TRACKS {
            return None;
        }
        let alone = views.iter().filter(|&&view| is_alone(view));
        let names: Vec<String> = alone.map(|&view| self.names[view].to_owned()).collect();
        let message = format!(
            "{} nothing that two others show, too: {}",
            match names.len() {
                0 => return None,
                1 => "1 image shows".to_owned(),
                count => format!("{count} images show"),
            },
            listed(&names)
        );
        let finding = Finding::new(Check::Poses, Level::Warning, message)
            .because(Cause::BadPose)
            .remedied_by("look whether they are of this scene, and take them out if not");
        Some(finding.of_views(names))
    }

    /// That the views fall into groups which agree within but not with each other, although
    /// the images of some look more like one of another group than like any of their own.
    fn groups(&self, trusted: &[bool]) -> Option<Finding> {
        let common = self.evidence().in_common(&self.cameras, trusted);
        let views: Vec<usize> = (0..self.gathered.views.len())
            .filter(|&index| trusted[self.gathered.views[index]])
            .collect();
        let agree = |i: usize, j: usize| {
            let tally = common.of([i, j].map(|index| self.gathered.views[index]));
            tally.explained >= MIN_EXPLAINED && tally.share() >= MIN_SHARE
        };
        let groups: Vec<Vec<usize>> = (connected(&views, agree).into_iter())
            .filter(|group| group.len() >= MIN_GROUP)
            .collect();
        if groups.len() < 2 {
            return None;
        }
        let count = self.gathered.views.len();
        let likeness = |i: usize, j: usize| match self.evidence() {
            // Matches that close no circle are often none.
            Evidence::Tracks { .. } => {
                common
                    .of([i, j].map(|index| self.gathered.views[index]))
                    .total as f64
            }
            Evidence::Corners(_) => {
                let (i, j) = (i.min(j), i.max(j));
                self.gathered.likeness[i * (2 * count - i - 1) / 2 + j - i - 1]
            }
        };
        let most_alike = |own: usize, others: &[usize]| {
            (others.iter().filter(|other| **other != own))
                .map(|&other| likeness(own, other))
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let in_groups =
            || (groups.iter()).flat_map(|group| group.iter().map(move |own| (*own, group)));
        let usual = median(in_groups().map(|(own, group)| most_alike(own, group)));
        let belongs_elsewhere = |(own, group): &(usize, &Vec<usize>)| {
            let others = groups.iter().filter(|other| other != group);
            let elsewhere = others.flatten().copied().collect::<Vec<usize>>();
            let elsewhere = most_alike(*own, &elsewhere);
            elsewhere >= usual && elsewhere > most_alike(*own, group)
        };
        if in_groups().filter(belongs_elsewhere).count() < MIN_LOST {
            return None;
        }
        let smallest = groups.iter().min_by_key(|group| group.len())?;
        let names: Vec<String> = (smallest.iter())
            .map(|&index| self.names[self.gathered.views[index]].to_owned())
            .collect();
        let message = format!(
            "the views fall into {} that agree within but not with each other; the smallest is {}",
            counted(groups.len(), "group"),
            listed(&names)
        );
        let finding = Finding::new(Check::Poses, Level::Warning, message)
            .because(Cause::PosesDisagree)
            .remedied_by("give all poses in one frame and unit, as of one reconstruction");
        Some(finding.of_views(names))
    }
}

/// The sets of views between any two of which a way of agreeing views leads.
fn connected(views: &[usize], agree: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let mut left = views.to_vec();
    let mut groups = Vec::new();
    while let Some(first) = left.pop() {
        let mut group = vec![first];
        let mut next = 0;
        while next < group.len() {
            let own = group[next];
            let (found, rest) = left.into_iter().partition(|&other| agree(own, other));
            left = rest;
            group.extend::<Vec<usize>>(found);
            next += 1;
        }
        group.sort_unstable();
        groups.push(group);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_connected_through_others() {
        let agree = |i: usize, j: usize| i.abs_diff(j) == 2;
        let groups = connected(&[0, 1, 2, 3, 4, 5, 6], agree);
        assert_eq!(groups, [vec![0, 2, 4, 6], vec![1, 3, 5]]);
    }
}
