// The windows of frames of the batch that LPIPS sees (perceptual.py): of its first, in recipe `paper` of all.

// (blocks of a window's pixels, windows). Render and target of the window about the frame's vertex; outside of the box both are
// background.
extern "C" __global__ void __launch_bounds__(256) cut_window(Scene s) {
    if (halted(s)) return;
    int b = blockIdx.y;
    Now &now = s.now[b];
    const Frame &f = now.frame;
    const float *vertex = s.vertices + 3 * (size_t(b) * s.vertex_count + now.plan.centre);
    float x = vertex[0] / vertex[2] * f.fx + f.cx + f.left, y = vertex[1] / vertex[2] * f.fy + f.cy + f.top;
    bool square = s.area > 0;
    int left = (square ? square_window_begin(x, s.window_width, s.whole_width) : window_begin(x, s.window_width, s.whole_width)) - f.left;
    int top = (square ? square_window_begin(y, s.window_height, s.whole_height) : window_begin(y, s.window_height, s.whole_height)) - f.top;
    int i = blockIdx.x * 256 + threadIdx.x, pixels = s.window_width * s.window_height;
    if (i == 0) {
        now.window_left = left;
        now.window_top = top;
    }
    if (i >= pixels) return;
    int px = left + i % s.window_width, py = top + i / s.window_width;
    const float *clear = now.background;
    Pixel pixel = {};
    pixel.image = pixel.target = {clear[0], clear[1], clear[2]};
    if (px >= 0 && py >= 0 && px < f.width && py < f.height) pixel = pixel_of(s, place_of(s, b * s.max_tiles), px, py);
    float *render = s.window + 3 * (size_t(b) * 2 * pixels + i), *target = render + 3 * size_t(pixels);
    render[0] = pixel.image.x; render[1] = pixel.image.y; render[2] = pixel.image.z;
    target[0] = pixel.target.x; target[1] = pixel.target.y; target[2] = pixel.target.z;
}
