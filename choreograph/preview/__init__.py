"""Previews of a dance: a shaded mannequin on any skeleton as page, video and pose strip, without a GPU.

- `page` — the offline HTML player; `page_assembly` its template, `compression` its data, `page/` its scripts
- `video`, `strip`, `sound` — MP4, contact sheet, the song's audio
- `motif_plots`, `motif_strip` — plots and pose strips of a repertoire's motifs
- `mannequin` — the skinned mesh, built by `_bind_pose`, `_trunk_mesh`, `_limb_mesh` and `_lofting`
- `renderer` — the software renderer, with `_raster_kernels` and `_shading_kernels`; `camera_path` its cameras
"""
