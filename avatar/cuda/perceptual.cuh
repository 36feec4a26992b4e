// The window of the batch's first frame that LPIPS sees (perceptual.py).

// (blocks of the window's pixels). Render and target of the window about the step's vertex; outside of the box both are background.
extern "C" __global__ void __launch_bounds__(256) cut_window(Scene s) {
    if (halted(s)) return;
    Now &now = s.now[0];
    const Frame &f = now.frame;
    const float *vertex = s.vertices + 3 * now.plan.centre;
    float x = vertex[0] / vertex[2] * f.fx + f.cx + f.left, y = vertex[1] / vertex[2] * f.fy + f.cy + f.top;
    int left = window_begin(x, s.window_width, s.whole_width) - f.left, top = window_begin(y, s.window_height, s.whole_height) - f.top;
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
    if (px >= 0 && py >= 0 && px < f.width && py < f.height) pixel = pixel_of(s, place_of(s, 0), px, py);
    float *render = s.window + 3 * size_t(i), *target = render + 3 * size_t(pixels);
    render[0] = pixel.image.x; render[1] = pixel.image.y; render[2] = pixel.image.z;
    target[0] = pixel.target.x; target[1] = pixel.target.y; target[2] = pixel.target.z;
}
