"""What the README shows works."""

import re
from pathlib import Path

README = Path(__file__).parents[2] / "README.md"


def test_the_example_measures_the_sphere(capsys):
    (example,) = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    exec(compile(example, "README.md", "exec"), {})
    assert abs(float(capsys.readouterr().out) - 100) < 0.05
