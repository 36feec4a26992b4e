// Losses of the image and their gradient, on the tiles where render or target show anything; elsewhere both are background.

constexpr int REACH = 5, WIDE = TILE + 2 * REACH;
// Row lengths in shared memory: lanes that take one row each, 16 bytes at a time, meet no bank twice.
constexpr int PITCH = 28, BLURRED = 20;
constexpr float C1 = 1e-4f, C2 = 9e-4f;
// 11-tap gaussian, sigma 1.5
__device__ constexpr float WINDOW[11] = {0.00102838f, 0.00759876f, 0.03600077f, 0.10936069f, 0.21300554f, 0.26601172f,
                                         0.21300554f, 0.10936069f, 0.03600077f, 0.00759876f, 0.00102838f};

// A tile with the frame it lies in.
struct Place {
    int b, tile, left, top, width, height, columns;
};

FORMULA Place place_of(const Scene &s, int tile) {
    Place p;
    p.tile = tile;
    p.b = tile / s.max_tiles;
    const Now &now = s.now[p.b];
    int t = tile % s.max_tiles;
    p.columns = now.columns;
    p.left = t % now.columns * TILE;
    p.top = t / now.columns * TILE;
    p.width = now.frame.width;
    p.height = now.frame.height;
    return p;
}

struct Pixel {
    float3 render, image, target;
    float alpha, mask;
};

// Premultiplied colour and alpha of a pixel; a tile without gaussians was not rendered.
FORMULA float4 render_at(const Scene &s, const Place &p, int x, int y) {
    if (!s.tile_count[p.b * s.max_tiles + y / TILE * p.columns + x / TILE]) return {0, 0, 0, 0};
    return ((const float4 *)s.image)[size_t(p.b) * s.max_pixels + y * p.width + x];
}

// Render, in the frame's exposure, and target over the batch's background. A side has its own outline for a mask, and no target.
FORMULA Pixel pixel_of(const Scene &s, const Place &p, int x, int y) {
    const Now &now = s.now[p.b];
    const float byte = 1 / 255.0f;
    uchar4 true_pixel = ((const uchar4 *)s.pixels)[now.frame.pixels + size_t(y) * p.width + x];
    float4 render = render_at(s, p, x, y);
    Pixel out;
    out.alpha = render.w;
    out.mask = true_pixel.w * byte;
    float clear = 1 - out.alpha, clear_target = 1 - out.mask;
    out.render = {render.x, render.y, render.z};
    out.image = {now.gain[0] * render.x + clear * now.background[0], now.gain[1] * render.y + clear * now.background[1],
                 now.gain[2] * render.z + clear * now.background[2]};
    out.target = {true_pixel.x * byte + clear_target * now.background[0], true_pixel.y * byte + clear_target * now.background[1],
                  true_pixel.z * byte + clear_target * now.background[2]};
    if (now.frame.sharp > 0) {
        out.mask = out.alpha > 0.5f ? 1 : 0;
        out.target = out.image;
    }
    return out;
}

// Weight of the L2 between alpha and mask.
FORMULA float mask_weight(const Scene &s, const Place &p) {
    float sharp = s.now[p.b].frame.sharp;
    return sharp > 0 ? sharp : s.mask;
}

// Weight of a channel of a pixel in the mean that the losses are.
FORMULA float share_of(const Scene &s, const Place &p) { return 1 / (3 * (s.area > 0 ? s.area : float(p.width) * p.height)); }

// Sum over the block, at thread 0.
FORMULA float sum_block(float v, float *scratch) {
    v = sum_warp(v);
    if (threadIdx.x % 32 == 0) scratch[threadIdx.x / 32] = v;
    __syncthreads();
    float sum = 0;
    if (threadIdx.x == 0)
        for (unsigned w = 0; w < blockDim.x / 32; ++w) sum += scratch[w];
    return sum;
}

FORMULA void load_row(const float *from, float *to) {
#pragma unroll
    for (int i = 0; i < 4; ++i) {
        float4 v = ((const float4 *)from)[i];
        to[4 * i] = v.x;
        to[4 * i + 1] = v.y;
        to[4 * i + 2] = v.z;
        to[4 * i + 3] = v.w;
    }
}

// What L2 and SSIM see of a pixel: in recipe `paper` both images times alpha times mask, a factor that passes no gradient.
FORMULA float seen_of(const Scene &s, const Pixel &pixel) { return s.masked ? pixel.alpha * pixel.mask : 1; }

FORMULA float3 operator*(float3 a, float f) { return {a.x * f, a.y * f, a.z * f}; }
FORMULA float4 operator*(float4 a, float f) { return {a.x * f, a.y * f, a.z * f, a.w * f}; }
FORMULA float4 operator-(float4 a, float4 b) { return {a.x - b.x, a.y - b.y, a.z - b.z, a.w - b.w}; }
FORMULA float dot(float4 a, float4 b) { return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w; }

// Grey render and target at a place of the square frame: outside of the box background, beyond the square zero.
FORMULA float2 greys_at(const Scene &s, const Place &p, int x, int y) {
    const Now &now = s.now[p.b];
    int in_x = x + now.frame.left, in_y = y + now.frame.top;
    if (in_x < 0 || in_y < 0 || in_x >= s.whole_width || in_y >= s.whole_height) return {0, 0};
    if (x >= 0 && y >= 0 && x < p.width && y < p.height) {
        Pixel pixel = pixel_of(s, p, x, y);
        return {grey(pixel.image.x, pixel.image.y, pixel.image.z), grey(pixel.target.x, pixel.target.y, pixel.target.z)};
    }
    float ground = grey(now.background[0], now.background[1], now.background[2]);
    return {ground, ground};
}

// (blocks). The tile's share of the loss, and SSIM's slopes by the window means: dS/dmx, dS/dq, dS/dp for three channels.
extern "C" __global__ void __launch_bounds__(PIXELS) compare(Scene s) {
    __shared__ __align__(16) float image[3][WIDE * PITCH], target[3][WIDE * PITCH], blurred[4][3][WIDE * BLURRED];
    __shared__ float scratch[8];
    if (halted(s)) return;
    int tid = threadIdx.x, total = s.state->near;
    for (int item = blockIdx.x; item < total; item += gridDim.x) {
        const Place p = place_of(s, s.near[item]);
        const float share = share_of(s, p);
        float loss = 0, shown = 0, masked = 0, both = 0, squared = 0;
        __syncthreads();
        for (int e = tid; e < WIDE * WIDE; e += PIXELS) {
            int r = e / WIDE, c = e % WIDE, x = p.left + c - REACH, y = p.top + r - REACH;
            Pixel pixel = {};
            if (x >= 0 && y >= 0 && x < p.width && y < p.height) {
                pixel = pixel_of(s, p, x, y);
                float seen = seen_of(s, pixel);
                pixel.image = pixel.image * seen;
                pixel.target = pixel.target * seen;
                if (r >= REACH && c >= REACH && r < REACH + TILE && c < REACH + TILE) {
                    float dx = pixel.image.x - pixel.target.x, dy = pixel.image.y - pixel.target.y;
                    float dz = pixel.image.z - pixel.target.z, da = pixel.alpha - pixel.mask;
                    loss += share * (dx * dx + dy * dy + dz * dz) + 3 * share * mask_weight(s, p) * da * da;
                    shown += pixel.alpha;
                    masked += pixel.mask;
                    both += pixel.alpha * pixel.mask;
                    squared += pixel.mask * pixel.mask;
                }
            }
            int to = r * PITCH + c;
            image[0][to] = pixel.image.x; image[1][to] = pixel.image.y; image[2][to] = pixel.image.z;
            target[0][to] = pixel.target.x; target[1][to] = pixel.target.y; target[2][to] = pixel.target.z;
        }
        __syncthreads();
        if (s.ssim > 0) {
            for (int task = tid; task < 3 * 4 * WIDE; task += PIXELS) {
                int channel = task / (4 * WIDE), r = task % WIDE, c = task / WIDE % 4 * 4;
                float x[16], y[16], out[4][4] = {};
                load_row(image[channel] + r * PITCH + c, x);
                load_row(target[channel] + r * PITCH + c, y);
#pragma unroll
                for (int i = 0; i < 14; ++i) {
                    float q = x[i] * x[i] + y[i] * y[i], xy = x[i] * y[i];
#pragma unroll
                    for (int k = 0; k < 4; ++k)
                        if (i - k >= 0 && i - k < 11) {
                            float w = WINDOW[i - k];
                            out[0][k] += w * x[i]; out[1][k] += w * y[i]; out[2][k] += w * q; out[3][k] += w * xy;
                        }
                }
#pragma unroll
                for (int m = 0; m < 4; ++m)
                    *(float4 *)(blurred[m][channel] + r * BLURRED + c) = {out[m][0], out[m][1], out[m][2], out[m][3]};
            }
            __syncthreads();
            for (int task = tid; task < 3 * TILE * 4; task += PIXELS) {
                int channel = task / (TILE * 4), c = task % TILE, r = task / TILE % 4 * 4;
                float mean[4][4] = {};
#pragma unroll
                for (int m = 0; m < 4; ++m)
#pragma unroll
                    for (int i = 0; i < 14; ++i) {
                        float v = blurred[m][channel][(r + i) * BLURRED + c];
#pragma unroll
                        for (int k = 0; k < 4; ++k)
                            if (i - k >= 0 && i - k < 11) mean[m][k] += WINDOW[i - k] * v;
                    }
#pragma unroll
                for (int k = 0; k < 4; ++k) {
                    int x = p.left + c, y = p.top + r + k;
                    if (x >= p.width || y >= p.height) continue;
                    float mx = mean[0][k], my = mean[1][k], squares = mx * mx + my * my, product = mx * my;
                    float a1 = 2 * product + C1, a2 = 2 * (mean[3][k] - product) + C2, b1 = squares + C1, b2 = mean[2][k] - squares + C2;
                    float scale = 1 / (b1 * b2), similarity = a1 * a2 * scale, over_b2 = similarity / b2;
                    loss += s.ssim * share * (1 - similarity);
                    float *to = s.slopes + (size_t(p.b) * 9 + channel) * s.max_pixels + y * p.width + x;
                    to[0] = 2 * ((a2 - a1) * my * scale + (over_b2 - similarity / b1) * mx);
                    to[size_t(3) * s.max_pixels] = -over_b2;
                    to[size_t(6) * s.max_pixels] = 2 * a1 * scale;
                }
            }
        }
        if (s.sobel > 0) {
            int r = tid / TILE, c = tid % TILE;
            if (p.left + c < p.width && p.top + r < p.height) {
                int at = (r + REACH) * PITCH + c + REACH;
                for (int channel = 0; channel < 3; ++channel) {
                    float d[3][3];
                    for (int i = 0; i < 3; ++i)
                        for (int k = 0; k < 3; ++k) {
                            int e = at + (i - 1) * PITCH + k - 1;
                            d[i][k] = image[channel][e] - target[channel][e];
                        }
                    float across = (d[0][2] + 2 * d[1][2] + d[2][2] - d[0][0] - 2 * d[1][0] - d[2][0]) / 4;
                    float down = (d[2][0] + 2 * d[2][1] + d[2][2] - d[0][0] - 2 * d[0][1] - d[0][2]) / 4;
                    loss += s.sobel * share * (across * across + down * down);
                }
            }
        }
        if (s.edges > 0) {
            float *own = image[0], *real = target[0];
            __syncthreads();
            for (int e = tid; e < 18 * 18; e += PIXELS) {
                float2 greys = greys_at(s, p, p.left + e % 18 - 1, p.top + e / 18 - 1);
                own[e] = greys.x;
                real[e] = greys.y;
            }
            __syncthreads();
            int r = tid / TILE, c = tid % TILE, at = (r + 1) * 18 + c + 1;
            if (p.left + c < p.width && p.top + r < p.height)
                loss += 3 * share * s.edges * fabsf(strength(own[at + 1] - own[at - 1], own[at + 18] - own[at - 18])
                                                    - strength(real[at + 1] - real[at - 1], real[at + 18] - real[at - 18]));
        }
        loss = sum_block(loss, scratch);
        if (tid == 0) s.tile_loss[p.tile] = loss;
        if (s.dice_weight > 0) {
            float *to = s.overlap + 4 * p.tile, sums[4] = {shown, masked, both, squared};
            for (int k = 0; k < 4; ++k) {
                __syncthreads();
                float sum = sum_block(sums[k], scratch);
                if (tid == 0) to[k] = sum;
            }
        }
    }
}

// (blocks). Gradient of the loss by the render's premultiplied colour and alpha, on the tiles that gaussians reach.
extern "C" __global__ void __launch_bounds__(PIXELS) image_gradient(Scene s) {
    __shared__ __align__(16) float slope[9][WIDE * PITCH], blurred[9][WIDE * BLURRED];
    __shared__ float scratch[8];
    if (halted(s)) return;
    int tid = threadIdx.x, heavy = s.state->heavy, total = heavy + s.state->light;
    for (int item = blockIdx.x; item < total; item += gridDim.x) {
        const Place p = place_of(s, item < heavy ? s.heavy[item] : s.light[item - heavy]);
        const float share = share_of(s, p);
        int r = tid / TILE, c = tid % TILE, x = p.left + c, y = p.top + r;
        bool inside = x < p.width && y < p.height;
        Pixel pixel = {};
        float sobel[3] = {}, grad[3] = {};
        if (inside) pixel = pixel_of(s, p, x, y);
        const float seen = seen_of(s, pixel);
        const float image[3] = {seen * pixel.image.x, seen * pixel.image.y, seen * pixel.image.z};
        const float target[3] = {seen * pixel.target.x, seen * pixel.target.y, seen * pixel.target.z};
        if (s.sobel > 0) {
            // the difference image with two pixels around the tile, its responses with one, in the slopes' room
            float(*d)[WIDE * PITCH] = slope, (*across)[WIDE * PITCH] = slope + 3, (*down)[WIDE * PITCH] = slope + 6;
            __syncthreads();
            for (int e = tid; e < 20 * 20; e += PIXELS) {
                int ex = p.left + e % 20 - 2, ey = p.top + e / 20 - 2;
                Pixel other = {};
                if (ex >= 0 && ey >= 0 && ex < p.width && ey < p.height) other = pixel_of(s, p, ex, ey);
                d[0][e] = other.image.x - other.target.x;
                d[1][e] = other.image.y - other.target.y;
                d[2][e] = other.image.z - other.target.z;
            }
            __syncthreads();
            for (int e = tid; e < 18 * 18; e += PIXELS) {
                int ex = p.left + e % 18 - 1, ey = p.top + e / 18 - 1, at = (e / 18 + 1) * 20 + e % 18 + 1;
                bool real = ex >= 0 && ey >= 0 && ex < p.width && ey < p.height;
                for (int k = 0; k < 3; ++k) {
                    const float *v = d[k] + at;
                    across[k][e] = real ? (v[-19] + 2 * v[1] + v[21] - v[-21] - 2 * v[-1] - v[19]) / 4 : 0;
                    down[k][e] = real ? (v[19] + 2 * v[20] + v[21] - v[-21] - 2 * v[-20] - v[-19]) / 4 : 0;
                }
            }
            __syncthreads();
            int at = (r + 1) * 18 + c + 1;
            for (int k = 0; k < 3; ++k) {
                const float *a = across[k] + at, *v = down[k] + at;
                sobel[k] = 2 * s.sobel * share * (a[-19] + 2 * a[-1] + a[17] - a[-17] - 2 * a[1] - a[19] + v[-19] + 2 * v[-18] + v[-17]
                                                  - v[17] - 2 * v[18] - v[19]) / 4;
            }
        }
        if (s.edges > 0) {
            // grey render and target with two pixels around the tile, the slopes by their differences with one
            float *own = slope[0], *real = slope[1], *across = slope[2], *down = slope[3];
            __syncthreads();
            for (int e = tid; e < 20 * 20; e += PIXELS) {
                float2 greys = greys_at(s, p, p.left + e % 20 - 2, p.top + e / 20 - 2);
                own[e] = greys.x;
                real[e] = greys.y;
            }
            __syncthreads();
            for (int e = tid; e < 18 * 18; e += PIXELS) {
                int ex = p.left + e % 18 - 1, ey = p.top + e / 18 - 1, at = (e / 18 + 1) * 20 + e % 18 + 1;
                float gx = own[at + 1] - own[at - 1], gy = own[at + 20] - own[at - 20];
                float tx = real[at + 1] - real[at - 1], ty = real[at + 20] - real[at - 20];
                bool counted = ex >= 0 && ey >= 0 && ex < p.width && ey < p.height;
                float factor = counted ? strength_slope(strength(gx, gy), strength(tx, ty), 3 * share * s.edges) : 0;
                across[e] = factor * gx;
                down[e] = factor * gy;
            }
            __syncthreads();
            int at = (r + 1) * 18 + c + 1;
            float slope_grey = across[at - 1] - across[at + 1] + down[at - 18] - down[at + 18];
            sobel[0] += grey(1.0f, 0.0f, 0.0f) * slope_grey;
            sobel[1] += grey(0.0f, 1.0f, 0.0f) * slope_grey;
            sobel[2] += grey(0.0f, 0.0f, 1.0f) * slope_grey;
        }
        if (s.ssim > 0) {
            __syncthreads();
            for (int e = tid; e < WIDE * WIDE; e += PIXELS) {
                int er = e / WIDE, ec = e % WIDE, ex = p.left + ec - REACH, ey = p.top + er - REACH;
                bool real = ex >= 0 && ey >= 0 && ex < p.width && ey < p.height;
                const float *from = s.slopes + size_t(p.b) * 9 * s.max_pixels + ey * p.width + ex;
#pragma unroll
                for (int k = 0; k < 9; ++k) slope[k][er * PITCH + ec] = real ? from[size_t(k) * s.max_pixels] : 0;
            }
            __syncthreads();
            for (int task = tid; task < 9 * 4 * WIDE; task += PIXELS) {
                int plane = task / (4 * WIDE), er = task % WIDE, ec = task / WIDE % 4 * 4;
                float v[16], out[4] = {};
                load_row(slope[plane] + er * PITCH + ec, v);
#pragma unroll
                for (int i = 0; i < 14; ++i)
#pragma unroll
                    for (int k = 0; k < 4; ++k)
                        if (i - k >= 0 && i - k < 11) out[k] += WINDOW[i - k] * v[i];
                *(float4 *)(blurred[plane] + er * BLURRED + ec) = {out[0], out[1], out[2], out[3]};
            }
            __syncthreads();
            for (int task = tid; task < 9 * 4 * TILE; task += PIXELS) {
                int plane = task / (4 * TILE), ec = task % TILE, er = task / TILE % 4 * 4;
                float out[4] = {};
#pragma unroll
                for (int i = 0; i < 14; ++i) {
                    float v = blurred[plane][(er + i) * BLURRED + ec];
#pragma unroll
                    for (int k = 0; k < 4; ++k)
                        if (i - k >= 0 && i - k < 11) out[k] += WINDOW[i - k] * v;
                }
#pragma unroll
                for (int k = 0; k < 4; ++k) slope[plane][(er + k) * TILE + ec] = out[k];
            }
            __syncthreads();
            for (int k = 0; k < 3; ++k)
                grad[k] = -s.ssim * share * (slope[k][tid] + 2 * slope[3 + k][tid] * image[k] + slope[6 + k][tid] * target[k]);
            __syncthreads();
        }
        const Now &now = s.now[p.b];
        float lpips[3] = {};
        if (now.plan.centre >= 0) {
            int wx = x - now.window_left, wy = y - now.window_top;
            if (wx >= 0 && wy >= 0 && wx < s.window_width && wy < s.window_height)
                for (int k = 0; k < 3; ++k)
                    lpips[k] = s.perceptual * s.window_slope[3 * ((size_t(p.b) * s.window_height + wy) * s.window_width + wx) + k];
        }
        float4 out = {0, 0, 0, 6 * share * mask_weight(s, p) * (pixel.alpha - pixel.mask)};
        if (s.dice_weight > 0) out.w += s.dice[0] * (1 - pixel.mask);
        for (int k = 0; k < 3; ++k) {
            grad[k] = now.frame.sharp > 0 ? 0 : seen * (grad[k] + 2 * share * (image[k] - target[k])) + lpips[k] + sobel[k];
            out.w -= grad[k] * now.background[k];
        }
        out.x = now.gain[0] * grad[0];
        out.y = now.gain[1] * grad[1];
        out.z = now.gain[2] * grad[2];
        if (inside) ((float4 *)s.grad_image)[size_t(p.b) * s.max_pixels + y * p.width + x] = out;
        if (s.gain_part) {
            const float render[3] = {pixel.render.x, pixel.render.y, pixel.render.z};
            for (int k = 0; k < 3; ++k) {
                __syncthreads();
                float sum = sum_block(inside ? grad[k] * render[k] : 0, scratch);
                if (tid == 0) s.gain_part[3 * p.tile + k] = sum;
            }
        }
    }
}
