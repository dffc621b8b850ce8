"""Shader node trees as plain data (`reader`), their translation to GLSL (`compiler`), and lobe albedos (`energy`)."""
