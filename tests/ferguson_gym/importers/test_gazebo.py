"""Gazebo worlds: shapes where their poses put them, safe parsing, and what is refused."""

import numpy as np
import pytest

from ferguson_gym.importers import Placement, read_world
from tests.support.places import ROOT

CYLINDER = "<cylinder><radius>0.5</radius><length>1</length></cylinder>"
BOX = "<box><size>4 2 1</size></box>"


def world(body, before="<?xml version='1.0'?>"):
    return f"{before}<sdf version='1.6'><world name='default'>{body}</world></sdf>"


def model(shape, pose="0 0 0 0 0 0", link="0 0 0 0 0 0", collision="0 0 0 0 0 0", name="m"):
    return (
        f"<model name='{name}'><pose frame=''>{pose}</pose><link name='l'><pose>{link}</pose>"
        f"<collision name='c'><pose>{collision}</pose><geometry>{shape}</geometry></collision>"
        "</link></model>"
    )


def read(tmp_path, text, **options):
    path = tmp_path / "w.world"
    path.write_text(text)
    return read_world(path, **options)


def test_the_example_has_all_its_posts_and_walls():
    placement = Placement(start=(2.2, -1.8), goal=(2.2, 8.6))
    field = read_world(ROOT / "examples" / "worlds" / "posts.world", placement)
    number = np.diff(field.obstacles.starts)
    assert ((number == 1).sum(), (number == 4).sum()) == (36, 3)
    assert set(field.obstacles.radii[number == 1]) == {0.12}
    walls = field.obstacles.only(number == 4).points[:8].reshape(2, 4, 2)
    sizes = np.ptp(walls, axis=1)
    np.testing.assert_allclose(sizes, [[0.1, 8.0]] * 2, atol=1e-5)
    # segments in the paper's share of the distance from start to goal
    assert field.limits.longest == pytest.approx(15.0 * 10.4 / (100.0 * 2**0.5))
    assert field.limits.shortest == pytest.approx(0.2 * field.limits.longest)


def test_poses_of_models_links_and_collisions_are_composed(tmp_path):
    quarter = np.pi / 2.0
    placed = model(CYLINDER, f"1 2 0 0 0 {quarter}", f"3 0 0 0 0 {quarter}", "0 1 5 0 0 7")
    field = read(tmp_path, world(placed + model(BOX, f"9 9 0 0 0 {quarter}", name="b")))
    # along y by 3, then turned twice: y is against y
    np.testing.assert_allclose(field.obstacles.core(0), [[1.0, 4.0]], atol=1e-12)
    box = field.obstacles.core(1)
    np.testing.assert_allclose([box.min(axis=0), box.max(axis=0)], [[8, 7], [10, 11]], atol=1e-12)


def test_models_within_models_states_and_scales(tmp_path):
    inner = model(CYLINDER, "1 0 0 0 0 0", name="inner")
    outer = f"<model name='outer'><pose>0 2 0 0 0 0</pose>{inner}</model>"
    state = "<state><model name='m'><pose>5 5 0 0 0 0</pose></model></state>"
    harmless = "<include><uri>model://sun</uri></include>" + model("<plane/>", name="ground")
    body = outer + model(CYLINDER) + state + harmless
    field = read(tmp_path, world(body), scale=10.0)
    np.testing.assert_allclose(field.obstacles.centers, [[10.0, 20.0], [50.0, 50.0]])
    assert field.obstacles.radii.tolist() == [5.0, 5.0]


LAUGHS = "<!DOCTYPE sdf [<!ENTITY a 'b'>]>"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<sdf", "w.world: not XML: "),
        ("", "w.world: not XML: "),
        ("<robot/>", "outermost element is sdf, got robot"),
        (world(model(CYLINDER), LAUGHS), "a document type or entities are declared"),
        (world(""), "no collision of a model is a cylinder, sphere or box"),
        (world(model("<mesh/>")), "model 'm', link 'l', collision 'c' is a mesh; shapes must be"),
        (world(model(CYLINDER, "0 0 0 0.5 0 0")), "model 'm' lies or leans .roll 0.5, pitch 0."),
        (world(model(CYLINDER, "0 0 0")), "model 'm': pose must be 6 numbers, got '0 0 0'"),
        (world(model(CYLINDER, "0 0 0 0 0 nan")), "pose must be 6 numbers"),
        (world(model(CYLINDER.replace("0.5", "-1"))), "a radius must be above 0, got -1"),
        (world(model(CYLINDER.replace("0.5", ""))), "radius must be 1 number, got ''"),
        (world(model("<cylinder/>")), "radius must be 1 number, got None"),
        (world(model(BOX.replace("4", "0"))), "sides must be above 0, got 0 and 2"),
        (world(model(BOX + BOX)), "has 2 shapes; it may have one"),
        (world(model(CYLINDER).replace("frame=''", "relative_to='x'")), "in the frame 'x'"),
        (world(model(CYLINDER).replace("frame=''", "degrees='true'")), "metres and radians"),
        (
            world("<state><model name='m'><scale>2 1 1</scale></model></state>"),
            "the state of model 'm' has the scale 2 1 1; it must be 1 1 1",
        ),
        (world("<include><uri>model://house</uri></include>"), "includes 'model://house'"),
        (world("<model name='m'><include/></model>"), "model 'm' includes another model"),
        (world("<model name='m'>" * 20 + "</model>" * 20), "more than 16 models within"),
    ],
)
def test_bad_worlds_are_refused_by_name(text, message, tmp_path):
    with pytest.raises(ValueError, match=message) as refused:
        read(tmp_path, text)
    assert str(refused.value).startswith(str(tmp_path / "w.world"))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_entities_are_refused_in_every_encoding(encoding, tmp_path):
    text = world(model("&a;"), f"<?xml version='1.0' encoding='{encoding}'?>{LAUGHS}")
    (tmp_path / "w.world").write_bytes(text.encode(encoding))
    with pytest.raises(ValueError, match="document type or entities"):
        read_world(tmp_path / "w.world")
