//! Graphs of images, views and matches: what is connected, and in which order to go through it.

use std::collections::{BTreeSet, VecDeque};

/// The component of each of `count` nodes, named by its smallest node. Edges beyond the nodes are ignored.
pub fn components(count: usize, edges: impl IntoIterator<Item = (usize, usize)>) -> Vec<usize> {
    fn root(label: &mut [usize], mut v: usize) -> usize {
        while label[v] != v {
            label[v] = label[label[v]];
            v = label[v];
        }
        v
    }
    let mut label: Vec<usize> = (0..count).collect();
    for (a, b) in edges {
        if a.max(b) < count {
            let (a, b) = (root(&mut label, a), root(&mut label, b));
            label[a.max(b)] = a.min(b);
        }
    }
    (0..count).map(|v| root(&mut label, v)).collect()
}

/// The name of the component of most nodes, of [`components`]; of equal ones the first. `None` without nodes.
pub(crate) fn largest_component(labels: &[usize]) -> Option<usize> {
    let mut size = vec![0usize; labels.len()];
    for &label in labels {
        size[label] += 1;
    }
    (0..size.len()).max_by(|&a, &b| size[a].cmp(&size[b]).then(b.cmp(&a)))
}

/// A node as [`spanning_forest`] reaches it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TreeNode {
    /// The node.
    pub node: usize,
    /// The edge (its index) that leads to it, and the node it comes from; `None`: the first of its component.
    pub by: Option<(usize, usize)>,
}

/// All nodes in an order in which each but the first of its component is led to by an edge from one before: always the first edge
/// of the list that leads on (Prim, where the list has the best edges first). Components come in the order of their first nodes.
pub(crate) fn spanning_forest(count: usize, edges: &[(usize, usize)]) -> Vec<TreeNode> {
    let mut found = vec![false; count];
    let mut at: Vec<Vec<usize>> = vec![Vec::new(); count];
    for (e, &(a, b)) in edges.iter().enumerate() {
        if a.max(b) < count {
            at[a].push(e);
            at[b].push(e);
        }
    }
    let mut order = Vec::with_capacity(count);
    for first in 0..count {
        if found[first] {
            continue;
        }
        found[first] = true;
        order.push(TreeNode { node: first, by: None });
        let mut open: BTreeSet<usize> = at[first].iter().copied().collect();
        while let Some(e) = open.pop_first() {
            let (a, b) = edges[e];
            if found[a] && found[b] {
                continue;
            }
            let (from, node) = if found[a] { (a, b) } else { (b, a) };
            found[node] = true;
            order.push(TreeNode { node, by: Some((e, from)) });
            open.extend(&at[node]);
        }
    }
    order
}

/// Nodes connected with the first, nearest first.
pub(crate) fn breadth_first(neighbours: &[BTreeSet<usize>], first: usize) -> Vec<usize> {
    let mut found = vec![false; neighbours.len()];
    found[first] = true;
    let mut queue = VecDeque::from([first]);
    let mut order = Vec::new();
    while let Some(v) = queue.pop_front() {
        order.push(v);
        for &n in &neighbours[v] {
            if !std::mem::replace(&mut found[n], true) {
                queue.push_back(n);
            }
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_have_the_name_of_their_first_node() {
        let labels = components(7, [(5, 3), (6, 5), (1, 0), (9, 2)]);
        assert_eq!(labels, [0, 0, 2, 3, 4, 3, 3]);
        assert_eq!(largest_component(&labels), Some(3));
        assert_eq!(largest_component(&components(4, [(0, 3), (1, 2)])), Some(0), "of equal ones the first");
        assert_eq!(largest_component(&[]), None);
    }

    #[test]
    fn the_forest_follows_the_best_edge_that_leads_on() {
        let edges = [(3, 4), (1, 2), (0, 2), (0, 1)];
        let order = spanning_forest(5, &edges);
        let of = |node, by| TreeNode { node, by };
        assert_eq!(
            order,
            [of(0, None), of(2, Some((2, 0))), of(1, Some((1, 2))), of(3, None), of(4, Some((0, 3)))],
            "3-4 does not lead on from 0"
        );
    }

    #[test]
    fn breadth_first_goes_by_distance() {
        let sets = |lists: &[&[usize]]| lists.iter().map(|l| l.iter().copied().collect()).collect::<Vec<_>>();
        let neighbours = sets(&[&[3, 1], &[0, 2], &[1], &[0], &[]]);
        assert_eq!(breadth_first(&neighbours, 0), [0, 1, 3, 2]);
        assert_eq!(breadth_first(&neighbours, 4), [4]);
    }
}
