//! What the documentation says of the loss, held to the table that the step reads.

use neat_train::LOSS_TERMS;

#[test]
fn the_documentation_has_the_table() {
    let rows = LOSS_TERMS
        .each_ref()
        .map(|term| format!("| `{}` | {} |\n", term.name, term.what));
    let documentation = include_str!("../../docs/method.md");
    let expected = format!(
        "| term | what, and by which function |\n| --- | --- |\n{}",
        rows.concat()
    );
    assert!(
        documentation.contains(&expected),
        "docs/method.md lacks:\n{expected}"
    );
}
