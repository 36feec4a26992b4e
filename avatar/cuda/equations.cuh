// Normal equations of a frame's pose: residuals of the image, and Lucas and Kanade's Hessian, as in
// stages/train/poses/photometric.py. A step is one frame.

constexpr int TURNING = 22, UNKNOWNS = 3 * TURNING + 3, POSE = 56 * 3;
constexpr int GROUP = 32, SQUARE = 5, PADDED = 16 * SQUARE;  // gaussians at a time; a thread's square of the sums, rows of such squares
constexpr float CLEAR = 0.1f, FLAT = 1e-8f, LEAST_SLOPE = 1e-12f;

// (blocks). Residuals as the image's gradient, products of the render's slopes over alpha, and each tile's squared error and pixels
// on the person.
extern "C" __global__ void __launch_bounds__(PIXELS) residuals(Scene s) {
    __shared__ float scratch[8];
    if (halted(s)) return;
    int tid = threadIdx.x, total = s.state->near;
    for (int item = blockIdx.x; item < total; item += gridDim.x) {
        const Place p = place_of(s, s.near[item]);
        int x = p.left + tid % TILE, y = p.top + tid / TILE;
        float square = 0, shown = 0;
        if (x < p.width && y < p.height) {
            Pixel pixel = pixel_of(s, p, x, y);
            int left = max(x - 1, 0), right = min(x + 1, p.width - 1), above = max(y - 1, 0), below = min(y + 1, p.height - 1);
            float wide = right - left == 2 ? 0.5f : 1, tall = below - above == 2 ? 0.5f : 1;
            float4 across = (render_at(s, p, right, y) - render_at(s, p, left, y)) * wide;
            float4 down = (render_at(s, p, x, below) - render_at(s, p, x, above)) * tall;
            float shared = fmaxf(pixel.alpha, CLEAR);
            float4 off = {pixel.image.x - pixel.target.x, pixel.image.y - pixel.target.y, pixel.image.z - pixel.target.z,
                          pixel.alpha - pixel.mask};
            size_t at = size_t(p.b) * s.max_pixels + y * p.width + x;
            ((float4 *)s.grad_image)[at] = off;
            ((float4 *)s.slopes)[at] = {dot(across, across) / shared, dot(across, down) / shared, dot(down, down) / shared, 0};
            if (pixel.alpha > 0.5f || pixel.mask > 0.5f) {
                square = dot(off, off);
                shown = 1;
            }
        }
        __syncthreads();
        square = sum_block(square, scratch);
        __syncthreads();
        shown = sum_block(shown, scratch);
        if (tid == 0) {
            s.tile_loss[p.tile] = square;
            s.tile_shown[p.tile] = shown;
        }
    }
}

// Where a gaussian is, m, and the root [a b; 0 c] of the slopes that it shows.
struct Shown {
    float x, y, z, a, b, c;
};

// (blocks). Each block's part of the Hessian over its gaussians, from the moments of the slopes; the next gradient of the
// compositing may begin.
extern "C" __global__ void __launch_bounds__(256) pose_hessian(Scene s) {
    __shared__ float rows[2 * GROUP][PADDED], axis[TURNING][9], place[TURNING][3];
    __shared__ Shown found[256];
    if (halted(s)) return;
    int tid = threadIdx.x, across = tid % 16 * SQUARE, down = tid / 16 * SQUARE;
    const Frame &frame = s.now[0].frame;
    if (blockIdx.x == 0 && tid == 0) s.state->back_ticket = 0;
    if (tid < TURNING) {
        const float *A = s.transform + tid * 12, *J = s.joints + 3 * tid;
        for (int i = 0; i < 3; ++i) {
            for (int k = 0; k < 3; ++k) axis[tid][3 * k + i] = A[4 * i + k];
            place[tid][i] = A[4 * i] * J[0] + A[4 * i + 1] * J[1] + A[4 * i + 2] * J[2] + A[4 * i + 3]
                            + float(s.pose[(frame.pose * 56 + 55) * 3 + i]);
        }
    }
    for (int e = tid; e < 2 * GROUP * PADDED; e += 256) (&rows[0][0])[e] = 0;
    float sum[SQUARE][SQUARE] = {};
    for (int first = blockIdx.x * 256; first < s.count; first += gridDim.x * 256) {
        int i = first + tid;
        Shown own = {};
        if (i < s.count) {
            ushort4 box = ((const ushort4 *)s.box)[i];
            int tiles = (box.y - box.x) * (box.w - box.z);
            const float *from = s.moments + 9 * size_t(s.slot_start[i]);
            float xx = 0, xy = 0, yy = 0;
            for (int k = 0; k < tiles; ++k, from += 9) {
                xx += from[6];
                xy += from[7];
                yy += from[8];
            }
            if (xx + yy > FLAT) {
                Vec<float> mean = posed(s, 0, i).bound.mean;
                float a = sqrtf(fmaxf(xx, LEAST_SLOPE)), b = xy / a;
                own = {mean.x, mean.y, mean.z, a, b, sqrtf(fmaxf(yy - b * b, 0))};
            }
        }
        __syncthreads();
        found[tid] = own;
        for (int group = 0; group < 256 && first + group < s.count; group += GROUP) {
            __syncthreads();
            int one = tid / 8;
            const Shown g = found[group + one];
            float *upper = rows[2 * one], *lower = rows[2 * one + 1];
            bool any = g.a > 0;
            float fx = any ? frame.fx / g.z : 0, fy = any ? frame.fy / g.z : 0, over_x = any ? g.x / g.z : 0, over_y = any ? g.y / g.z : 0;
            for (int j = tid % 8; j < TURNING; j += 8) {
                float w = any ? s.turn_share[size_t(first + group + one) * TURNING + j] : 0;
                float ax = g.x - place[j][0], ay = g.y - place[j][1], az = g.z - place[j][2];
                for (int k = 0; k < 3; ++k) {
                    const float *e = axis[j] + 3 * k;
                    float mz = w * (e[0] * ay - e[1] * ax);
                    float u = fx * (w * (e[1] * az - e[2] * ay) - over_x * mz), v = fy * (w * (e[2] * ax - e[0] * az) - over_y * mz);
                    upper[3 * j + k] = g.a * u + g.b * v;
                    lower[3 * j + k] = g.c * v;
                }
            }
            if (tid % 8 == 0) {
                upper[3 * TURNING] = g.a * fx;
                upper[3 * TURNING + 1] = g.b * fy;
                lower[3 * TURNING + 1] = g.c * fy;
                upper[3 * TURNING + 2] = -(g.a * fx * over_x + g.b * fy * over_y);
                lower[3 * TURNING + 2] = -g.c * fy * over_y;
            }
            __syncthreads();
            for (int r = 0; r < 2 * GROUP; ++r)
#pragma unroll
                for (int k = 0; k < SQUARE; ++k)
#pragma unroll
                    for (int l = 0; l < SQUARE; ++l) sum[k][l] += rows[r][down + k] * rows[r][across + l];
        }
    }
    float *to = s.hessian_part + size_t(blockIdx.x) * UNKNOWNS * UNKNOWNS;
    for (int k = 0; k < SQUARE; ++k)
        for (int l = 0; l < SQUARE; ++l)
            if (down + k < UNKNOWNS && across + l < UNKNOWNS) to[(down + k) * UNKNOWNS + across + l] = sum[k][l];
}

// (blocks of the Hessian's numbers). Keeps the equations of the step that has just ended.
extern "C" __global__ void __launch_bounds__(256) keep_equations(Scene s) {
    __shared__ float scratch[8];
    if (halted(s)) return;
    int tid = threadIdx.x, e = blockIdx.x * 256 + tid;
    size_t step = s.state->step - 1;
    if (e < UNKNOWNS * UNKNOWNS) {
        float sum = 0;
        for (int part = 0; part < s.hessian_parts; ++part) sum += s.hessian_part[size_t(part) * UNKNOWNS * UNKNOWNS + e];
        s.hessian[step * UNKNOWNS * UNKNOWNS + e] = sum;
    }
    if (blockIdx.x > 0) return;
    if (tid < POSE) s.pose_gradient[step * POSE + tid] = s.pose_grad_out[tid];
    float shown = 0;
    for (int t = tid; t < s.now[0].columns * s.now[0].rows; t += 256)
        if (s.near_flag[t]) shown += s.tile_shown[t];
    shown = sum_block(shown, scratch);
    if (tid == 0) s.shown[step] = shown;
}
