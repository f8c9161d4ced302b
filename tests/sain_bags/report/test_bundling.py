"""The page's scripts: each file has its own names, and shares what it lists."""

import pytest

from sain_bags.report.writing import SCRIPT, _part, bundle


def modules(**texts):
    return lambda name: texts[name.removesuffix(".js")]


def test_a_file_that_is_imported_twice_runs_once_and_first():
    script = bundle("page.js", modules(
        page='import { b } from "./b.js";\nimport { a } from "./a.js";\nshow(a, b);\n',
        b='import { a } from "./a.js";\nconst b = a;\nexport { b };\n',
        a="const a = 1;\nexport { a };\n",
    ))  # fmt: skip
    places = [script.index(f'modules["{name}.js"] =') for name in ("a", "b", "page")]
    assert places == sorted(places) and script.count('modules["a.js"] =') == 1


def test_a_name_that_is_not_shared_cannot_be_imported():
    read = modules(
        page='import { a, c } from "./a.js";\n', a="const a = 1, c = 2;\nexport { a };\n"
    )
    with pytest.raises(ValueError, match=r"page.js imports \['c'\], which a.js does not export"):
        bundle("page.js", read)


def test_files_that_import_each_other_are_refused():
    read = modules(
        a='import { b } from "./b.js";\nexport { a };\n',
        b='import { a } from "./a.js";\nexport { b };\n',
    )
    with pytest.raises(ValueError, match=r"a.js > b.js > a.js"):
        bundle("a.js", read)


@pytest.mark.parametrize("line", ['import * as a from "./a.js";', "export function f() {}"])
def test_other_forms_of_sharing_are_refused(line):
    with pytest.raises(ValueError, match="one plain list of names"):
        bundle("page.js", modules(page=line + "\n"))


def test_the_page_is_one_script_without_imports():
    script = bundle(SCRIPT, _part)
    assert "import " not in script and "export " not in script
