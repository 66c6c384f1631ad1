"""Checks the manifests of this folder against the schemas of Kubernetes.

    pip install kubernetes-validate && python validate.py

No cluster is needed. Unknown fields are errors, and so is a number of shards that
is not the number of completions.
"""

import pathlib
import sys

import kubernetes_validate
import yaml

VERSION = "1.31"


def main() -> int:
    failed = 0
    for path in sorted(pathlib.Path(__file__).parent.glob("*.yaml")):
        for document in yaml.safe_load_all(path.read_text()):
            try:
                kubernetes_validate.validate(document, VERSION, strict=True)
                check_shards(document)
            except (kubernetes_validate.ValidationError, ValueError) as error:
                print(f"{path.name}: {error}", file=sys.stderr)
                failed += 1
            else:
                print(f"{path.name}: a valid {document['kind']}")
    return 1 if failed else 0


def check_shards(document: dict) -> None:
    """Of an Indexed Job: as many shards as there are pods to do them."""
    spec = document["spec"]
    if spec.get("completionMode") != "Indexed":
        return
    [container] = spec["template"]["spec"]["containers"]
    variables = {variable["name"]: variable["value"] for variable in container["env"]}
    if variables["NEAT_SHARDS"] != str(spec["completions"]):
        raise ValueError("NEAT_SHARDS is not the number of completions")


if __name__ == "__main__":
    sys.exit(main())
