#version 330

// The depth is drawn by itself, and the target has no colours.
void main() {
}
