"""Profiles that leave nothing out at the walls, as most closed forms want them."""

from functools import partial

from multicor_cli import post

profile = partial(post.profile, exclude_walls=0.0)
profiles = partial(post.profiles, exclude_walls=0.0)
