"""The findings: of each what is the matter, and what to do about it (chapter 12)."""

from __future__ import annotations

from typing import NamedTuple

from fpputil.capture.quality import Reason

FINDINGS = {
    "exchanged": ("{first} and {second} are exchanged", "exchange their names"),
    "frame": (
        "{files}: does not fit the other steps of {fringe}{same}",
        "photograph again: a trigger was missed, a step was shown twice or too late, or the light "
        "changed",
    ),
    "swapped": (
        "the fringes called {pitches} look like {likely}",
        "exchange the names of the photographs, or the pitches in the pattern file",
    ),
    "pitch": (
        "pitches {pitches} along the {axis}s are given; the photographs show {likely}, if the "
        "first is right",
        "give the pitches that were projected",
    ),
    "direction": (
        "the projector's {axis}s grow {way} in the picture",
        "project writing and photograph it: if it stands upright, the steps go the other way: give "
        "shift {shift}; on its head, the projector or the camera hangs so and the phases are right:"
        " use --accept, or --system with a calibration of this mounting; mirrored, a mirror image "
        "is set in the projector's menu or the camera's program",
    ),
    "mounting": (
        "the projector's {axis}s grow {way} in the picture, by the system {expected}",
        "project writing and photograph it: by the system it {writing}; if it does, the steps go "
        "the other way: give shift {shift}; if not, the system is of another mounting: calibrate "
        "this one",
    ),
    "mirrored": (
        "the photographs are mirrored left to right{against}",
        "if writing on the scene reads backwards, the camera's program mirrors, else the "
        "projector's menu (rear projection): set it right; or calibrate with photographs made the "
        "same way and give that --system",
    ),
    "bits": (
        "the pictures of bits {bits} of the Gray code along the {axis}s are exchanged (0 is the "
        "first)",
        "exchange their names",
    ),
    "inverted": (
        "black and white are exchanged in {bits} of the Gray code's pictures along the {axis}s (0 "
        "is the first)",
        "photograph the pictures of `fpp patterns`, or invert the photographs",
    ),
    "against": (
        "the fringes along the {axis}s run against their Gray code: their steps go the other way, "
        "or black and white are exchanged in the code's first picture",
        "give --shift {shift}; if that does not help, invert the first picture instead",
    ),
    "backwards": (
        "the bits of the Gray code along the {axis}s come with the least significant one first",
        "name them in the other order",
    ),
    "binary": (
        "the code along the {axis}s looks like plain binary numbers, not like a Gray code",
        "project a Gray code: of binary numbers several bits change at one edge",
    ),
    "offset": (
        "the phases of {pair} are apart by {offset:+.2f} of an order everywhere{late}",
        "{start}check that both begin with step 0 and have the steps that were projected",
    ),
    "disagree": (
        "the phases of {pair} do not belong together",
        "{periods}check the pitches, the direction of the shift and the unwrapping; or the noise "
        "is far too high for these pitches",
    ),
    "saturated": (
        "the camera is saturated at {share:.0%} of the lit pixels",
        "expose less, or close the aperture, until no fringe reaches full scale",
    ),
    "clipped": (
        "the bright halves of {fringe} are flat, below the camera's full scale",
        "the projector is saturated: lower its brightness and contrast to their neutral values, "
        "or project with less amplitude",
    ),
    "square": (
        "the fringes of {fringe} are square, and {steps} steps let their harmonics through",
        "take many steps (18), put square fringes out of focus, or project sinusoids",
    ),
    "flicker": (
        "the brightness changes by up to {share:.0%} from photograph to photograph; it was "
        "divided out{but}",
        "let the exposure be a whole number of the projector's frames, and fix the camera's gain",
    ),
    "response": (
        "the response is not linear: the second harmonic is {second:+.1%} of the fringe",
        "with three or four steps it turns the phase by about as many radians: give --gamma, or "
        "take five steps or more at one pitch, or photographs in plain light and in none (white "
        "and black), which tell it; or project corrected patterns (fpp patterns --gamma)",
    ),
    "lost": ("{share:.0%} of the lit pixels are left out: {why}", "{remedy}"),
    "orders": (
        "the order is a guess at {share:.0%} of the lit pixels",
        "take more steps at the long pitches, or a pitch between two that are far apart{coded}",
    ),
    "levels": (
        "the grey levels reach {most:g}, so the photographs are taken for {said}, saturated at "
        "{full:g}",
        "give --full if the camera has other levels",
    ),
    "jpeg": (
        "{number} photographs are JPEG files: their compression adds noise to the phase, at "
        "quality 90 about 0.01 rad with twelve steps and 0.03 rad with three in dim light",
        "have the camera write PNG or TIFF; else the best quality, and more steps",
    ),
    "channel": (
        "the light is {channel}: grey keeps {grey:.0%} of that channel's level",
        "give --channel {channel}",
    ),
    "overflow": (
        "the {channel} channel is saturated at {share:.0%} of the lit pixels, which grey hides",
        "expose less, or give --channel with another one",
    ),
    "dark": (
        "{lit:.1%} of the pixels are lit, with a median modulation of {level:.0f} grey levels",
        "expose longer, open the aperture, or darken the room",
    ),
    "contrast": (
        "the modulation of the finest pitch is {contrast:.0%} of the light: the rest is noise "
        "without use",
        "darken the room, focus the projector and the camera on the object, or project a longer "
        "pitch",
    ),
    "relative": (
        "the phase was unwrapped from pixel to pixel: it is known but for a multiple of 2 pi, "
        "another one in each of {parts} connected part(s), and wrong beyond a step that turns it "
        "by more than pi",
        "take it as a relief of one smooth surface, or its difference to a plane (--reference); "
        "columns, depth and points need a second pitch or a Gray code",
    ),
    "noise": (
        "so few steps do not tell the noise, nor whether the response is linear; the uncertainty "
        "counts the rounding of grey levels alone",
        "take five steps or more at one pitch, or give --noise and --gamma",
    ),
}
"""Of each finding by its code what is the matter, and what to do about it."""

POINT_FINDINGS = {
    "range": (
        "{share:.0%} of the pixels in the mask have no depth from {span} ({near:.0%} lie nearer, "
        "{far:.0%} farther)",
        "give the system that was calibrated with this very rig; or, if things stand outside its "
        "measuring range, set z_min and z_max in its file",
    ),
    "beam": (
        "{share:.0%} of the points lie where the projector of the system sends no light",
        "the system is of another rig, or something moved since: calibrate this one",
    ),
    "apart": (
        "columns and rows contradict each other by {apart:.1f} projector pixels (median)",
        "the system is of another rig, or something moved since: calibrate this one",
    ),
    "blunt": (
        "by this system {other}s would tell the depth {times:.0f} times as sharply as these "
        "{axis}s",
        "project fringes along {other}s, or along both axes (fpp patterns --axis both)",
    ),
    "vague": (
        "the depth is uncertain by {sigma:.2g} mm (median)",
        "set camera and projector farther apart, take more steps or light, or a shorter pitch",
    ),
}
"""Of each finding about points by its code what is the matter, and what to do about it."""

LOST = {
    Reason.SCATTERED: (
        "their steps lie on no sinusoid",
        "project one fringe at a time, and keep light and scene still; or the number of steps is "
        "another one",
    ),
    Reason.UNSTEADY: (
        "their modulation changes from pitch to pitch, and not as that around them",
        "keep light and scene still from the first photograph to the last",
    ),
    Reason.OUTSIDE: (
        "their columns or rows lie outside the projector",
        "check the projector's size and the pitches",
    ),
}
"""Of reasons that no other finding tells, what is the matter, and what to do about it."""

SEVERE = ("exchanged", "frame", "swapped", "pitch", "direction", "offset", "disagree", "clipped")
SEVERE += ("square", "mounting", "mirrored", "bits", "inverted", "against", "backwards", "binary")
"""Findings with which the phases are wrong; with the others they are noisier or fewer."""

MOUNTED = ("direction", "mounting", "mirrored")
"""Findings on how the projector hangs, which a calibration takes as it is."""

ORDER = ("offset", "disagree", "orders")
FOLLOW = {
    **dict.fromkeys(("frame", "exchanged"), (*ORDER, "response", "square")),
    **dict.fromkeys(("swapped", "pitch", "direction", "mounting"), ORDER),
    **dict.fromkeys(
        ("bits", "inverted", "against", "backwards", "binary"), (*ORDER, "direction", "mounting")
    ),
    "offset": ("orders",),
    **dict.fromkeys(("dark", "saturated"), (*ORDER[1:], "noise", "pitch", "response")),
    "clipped": ("response",),
    "square": (*ORDER, "response", "clipped", "pitch"),
}
"""Findings that another one explains, and that are not told beside it."""


class Finding(NamedTuple):
    """What speaks against a capture: its code, what is the matter, what to do about it.

    The code is a key of `FINDINGS` or `POINT_FINDINGS`. With a severe one the phases, or the
    points, are wrong, not only noisier or fewer. `axis` is that of the fringes, "" if there is but
    one.
    """

    code: str
    severe: bool
    message: str
    remedy: str
    axis: str = ""

    @property
    def where(self) -> str:
        """Before the message in a list of several axes: ``"columns: "``."""
        return f"{self.axis}s: " if self.axis else ""


def finding_of(code: str, severe: bool | None = None, **values) -> Finding:
    """A finding by its code, its texts filled in with values."""
    message, remedy = (text.format(**values) for text in (FINDINGS | POINT_FINDINGS)[code])
    return Finding(code, code in SEVERE if severe is None else bool(severe), message, remedy)
