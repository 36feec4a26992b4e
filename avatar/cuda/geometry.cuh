// From poses to tile lists: skinning, binding + projection, and the list of gaussians of every tile.
// `Scene` is made by structs.py; `Plan`, `Frame`, `State` and `Now` are below.

constexpr double PULL_UNIT = 1.0 / (1ll << 60);  // sums of whole numbers have no order: one seed gives one result
constexpr int TILE = 16, PIXELS = TILE * TILE, SEGMENT = 128, HEAVY = 256;

// Frame, rates and background of a step, copied from plan and frames by the first kernel: the others read them with one load.
struct Now {
    Frame frame;
    Plan plan;
    float background[3], gain[3];
    int columns, rows, go, window_left, window_top;
};

FORMULA bool halted(const Scene &s) { return s.state->overflow != 0 || s.now[0].go == 0; }

// Room for n things, reserved by all 32 lanes of a warp with one atomic; returns where this lane's begin.
FORMULA int reserve(int *counter, int n) {
    int lane = threadIdx.x & 31, sum = n;
    for (int step = 1; step < 32; step *= 2) {
        int below = __shfl_up_sync(~0u, sum, step);
        if (lane >= step) sum += below;
    }
    int base = 0;
    if (lane == 31 && sum > 0) base = atomicAdd(counter, sum);
    return __shfl_sync(~0u, base, 31) + sum - n;
}

FORMULA Vec<float> vec(const float *p) { return {p[0], p[1], p[2]}; }

// Displacement of a vertex at rest by the learned expression of a frame.
FORMULA Vec<float> expressed(const Scene &s, int pose, int v) {
    Vec<float> sum = {0, 0, 0};
    const double *value = s.expression + size_t(pose) * s.expression_count;
    for (int k = 0; k < s.expression_count; ++k)
        sum = sum + vec(s.expression_dirs + 3 * (size_t(k) * s.vertex_count + v)) * float(value[k]);
    return sum;
}

// (blocks of vertices, batch). Every block walks the joint chain itself: cheaper than a kernel of its own.
extern "C" __global__ void __launch_bounds__(256) skin(Scene s) {
    __shared__ float local[55][9], transform[55][12];
    State &state = *s.state;
    int b = blockIdx.y, tid = threadIdx.x;
    bool go = state.overflow == 0 && state.step < state.stop;
    if (b == 0 && blockIdx.x == 0 && tid == 0 && !go) s.now[0].go = 0;
    if (!go) return;
    const Plan plan = s.plan[state.step];
    const Frame frame = s.frames[plan.level * s.frame_count + s.order[state.step * s.batch + b]];
    if (blockIdx.x == 0 && tid == 0) {
        Now &now = s.now[b];
        now.frame = frame;
        now.plan = plan;
        now.plan.centre = s.centres ? s.centres[state.step * s.batch + b] : b == 0 ? plan.centre : -1;
        for (int c = 0; c < 3; ++c) {
            now.background[c] = s.background[3 * (state.step * s.batch + b) + c];
            now.gain[c] = s.gain[3 * frame.pose + c];
        }
        now.columns = (frame.width + TILE - 1) / TILE;
        now.rows = (frame.height + TILE - 1) / TILE;
        now.go = 1;
        if (b == 0)
            state.pairs = state.listed = state.checkpoints = state.heavy = state.light = state.near = state.segments = state.blend_ticket = state.back_ticket = state.barrier =
            state.peak = 0;
        state.joints_done[b] = 0;
    }
    for (int i = blockIdx.x * 256 + tid; i < s.max_tiles; i += gridDim.x * 256) s.tile_count[b * s.max_tiles + i] = 0;

    int own_level = -1, p = 0;
    float J[3] = {};
    if (tid < 55) {
        own_level = s.joint_level[tid];
        p = s.parents[tid];
        for (int c = 0; c < 3; ++c) J[c] = s.joints[3 * tid + c];
        rodrigues(s.pose + (frame.pose * 56 + tid) * 3, local[tid]);
    }
    __syncthreads();
    for (int level = 0; level < s.levels; ++level) {
        if (own_level == level) {
            const float *L = local[tid], *P = transform[p < 0 ? 0 : p];
            float *A = transform[tid];
            for (int i = 0; i < 3; ++i) {
                for (int k = 0; k < 3; ++k)
                    A[4 * i + k] = p < 0 ? L[3 * i + k] : P[4 * i] * L[k] + P[4 * i + 1] * L[3 + k] + P[4 * i + 2] * L[6 + k];
                float place = p < 0 ? J[i] : P[4 * i] * J[0] + P[4 * i + 1] * J[1] + P[4 * i + 2] * J[2] + P[4 * i + 3];
                A[4 * i + 3] = place - (A[4 * i] * J[0] + A[4 * i + 1] * J[1] + A[4 * i + 2] * J[2]);
            }
        }
        __syncthreads();
    }
    if (blockIdx.x == 0) {
        for (int i = tid; i < 55 * 9; i += 256) s.local[b * 55 * 9 + i] = (&local[0][0])[i];
        for (int i = tid; i < 55 * 12; i += 256) s.transform[b * 55 * 12 + i] = (&transform[0][0])[i];
    }
    int v = blockIdx.x * 256 + tid;
    if (v >= s.vertex_count) return;
    Vec<float> rest = vec(s.rest + 3 * (size_t(frame.rest) * s.vertex_count + v)) + vec(s.offset + 3 * v), out = {0, 0, 0};
    if (s.expression) {
        rest = rest + expressed(s, frame.pose, v);
        float *worn = s.worn + 3 * (size_t(b) * s.vertex_count + v);
        worn[0] = rest.x;
        worn[1] = rest.y;
        worn[2] = rest.z;
    }
    const double *transl = s.pose + (frame.pose * 56 + 55) * 3;
    for (int k = 0; k < 4; ++k) {
        float w = s.skin_weight[4 * v + k];
        const float *A = transform[s.skin_index[4 * v + k]];
        out.x += w * (A[0] * rest.x + A[1] * rest.y + A[2] * rest.z + A[3]);
        out.y += w * (A[4] * rest.x + A[5] * rest.y + A[6] * rest.z + A[7]);
        out.z += w * (A[8] * rest.x + A[9] * rest.y + A[10] * rest.z + A[11]);
    }
    float *to = s.vertices + 3 * (b * s.vertex_count + v);
    to[0] = out.x + float(transl[0]);
    to[1] = out.y + float(transl[1]);
    to[2] = out.z + float(transl[2]);
}

// A gaussian with all that its projection needs, as the frame `b` of the batch has it posed.
struct Posed {
    Face<float> face;
    Turn<float> turn;
    Vec<float> mu;
    float log_scale[3], opacity, shade[3];
    Bound<float> bound;
    Lens<float> lens;
};

FORMULA Posed posed(const Scene &s, int b, int i) {
    Posed g;
    const Frame &f = s.now[b].frame;
    g.lens = {f.fx, f.fy, f.cx, f.cy, float(f.width), float(f.height), s.low_pass_px2, s.low_pass_energy != 0};
    const float *vertices = s.vertices + 3 * b * s.vertex_count;
    const int *corner = s.corner + 3 * i;
    g.face = face_frame(vec(vertices + 3 * corner[0]), vec(vertices + 3 * corner[1]), vec(vertices + 3 * corner[2]));
    float4 q = ((const float4 *)s.quat)[i];
    g.turn = turn_of(q.x, q.y, q.z, q.w);
    g.mu = vec(s.mu + 3 * i);
    for (int c = 0; c < 3; ++c) {
        g.log_scale[c] = s.log_scale[3 * i + c];
        if (s.scale_limit > 0) g.log_scale[c] = log_scale_of(g.log_scale[c], s.scale_limit);
    }
    g.opacity = 1 / (1 + __expf(-s.logit[i]));
    g.bound = bind(g.face, g.turn, g.mu, g.log_scale);
    for (int c = 0; c < 3; ++c) g.shade[c] = s.clip_light ? shade_of(s.clip_light, g.face.n, c) : 1;
    return g;
}

// (blocks of gaussians, batch). Splats, tile boxes, slots, and the gaussian's rank in each of its tiles.
extern "C" __global__ void __launch_bounds__(128) project(Scene s) {
    if (halted(s)) return;
    int b = blockIdx.y, i = blockIdx.x * 128 + threadIdx.x, at = b * s.count + i, tiles = 0;
    int x0 = 0, x1 = 0, y0 = 0, y1 = 0;
    if (i < s.count) {
        Posed g = posed(s, b, i);
        Splat<float> p = project(g.lens, g.bound, g.opacity);
        if (p.seen) {
            float first_x = fmaxf(ceilf(p.x - p.wide - 0.5f), 0), last_x = fminf(floorf(p.x + p.wide - 0.5f), g.lens.width - 1);
            float first_y = fmaxf(ceilf(p.y - p.high - 0.5f), 0), last_y = fminf(floorf(p.y + p.high - 0.5f), g.lens.height - 1);
            if (first_x <= last_x && first_y <= last_y) {
                x0 = int(first_x) / TILE;
                x1 = int(last_x) / TILE + 1;
                y0 = int(first_y) / TILE;
                y1 = int(last_y) / TILE + 1;
                tiles = (x1 - x0) * (y1 - y0);
                float4 *splat = (float4 *)s.splat + 3 * at;
                splat[0] = {p.x, p.y, p.ha, p.b};
                splat[1] = {p.hc, p.s_max, p.opacity, p.wide};
                splat[2] = {g.shade[0] * s.rgb[3 * i], g.shade[1] * s.rgb[3 * i + 1], g.shade[2] * s.rgb[3 * i + 2], p.high};
                s.depth[at] = g.bound.mean.z;
            }
        }
        ((ushort4 *)s.box)[at] = {(unsigned short)x0, (unsigned short)x1, (unsigned short)y0, (unsigned short)y1};
    }
    int slot = reserve(&s.state->pairs, tiles);
    if (i >= s.count) return;
    s.slot_start[at] = slot;
    if (slot + tiles > s.pair_room) return;
    for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x)
            s.rank[slot++] = atomicAdd(&s.tile_count[b * s.max_tiles + y * s.now[b].columns + x], 1);
}

// (blocks of tiles, batch). Gives each tile its place in the list; the tiles to blend, to compare, and the segments.
extern "C" __global__ void __launch_bounds__(256) allocate(Scene s) {
    if (halted(s)) return;
    State &state = *s.state;
    int b = blockIdx.y, t = blockIdx.x * 256 + threadIdx.x, n = 0;
    bool near = false;
    if (state.pairs > s.pair_room) {
        if (b == 0 && t == 0) {
            state.needed = state.pairs;
            state.overflow = 1;
        }
        return;
    }
    const Now &now = s.now[b];
    int columns = now.columns, rows = now.rows, tile = b * s.max_tiles + t;
    if (b == 0 && t == 0 && state.pairs > state.most) state.most = state.pairs;
    if (t < columns * rows) {
        n = s.tile_count[tile];
        int r = t / columns, c = t % columns;
        for (int y = max(r - 1, 0); y <= min(r + 1, rows - 1); ++y)
            for (int x = max(c - 1, 0); x <= min(c + 1, columns - 1); ++x)
                near = near || s.tile_count[b * s.max_tiles + y * columns + x] || s.occupied[now.frame.tiles + y * columns + x];
        s.near_flag[tile] = near;
    }
    int segments = (n + SEGMENT - 1) / SEGMENT;
    int start = reserve(&state.listed, n), check = reserve(&state.checkpoints, max(segments - 1, 0));
    int segment = reserve(&state.segments, segments);
    int heavy = reserve(&state.heavy, n > HEAVY), light = reserve(&state.light, n > 0 && n <= HEAVY);
    int compare = reserve(&state.near, near);
    if (t < columns * rows) {
        s.tile_start[tile] = start;
        s.tile_check[tile] = check;
        if (n > HEAVY) s.heavy[heavy] = tile;
        else if (n > 0) s.light[light] = tile;
        if (near) s.near[compare] = tile;
        for (int k = 0; k < segments; ++k) ((int2 *)s.segment)[segment + k] = {tile, k};
    }
}

// (blocks of gaussians, batch). Depth and index in one key, so that equal depths have one order.
extern "C" __global__ void __launch_bounds__(128) fill(Scene s) {
    if (halted(s)) return;
    int b = blockIdx.y, i = blockIdx.x * 128 + threadIdx.x, at = b * s.count + i;
    if (i >= s.count) return;
    ushort4 box = ((ushort4 *)s.box)[at];
    if (box.x == box.y) return;
    unsigned long long key = (unsigned long long)__float_as_uint(s.depth[at]) << 32 | unsigned(i);
    int slot = s.slot_start[at];
    for (int y = box.z; y < box.w; ++y)
        for (int x = box.x; x < box.y; ++x) {
            int tile = b * s.max_tiles + y * s.now[b].columns + x;
            s.list[s.tile_start[tile] + s.rank[slot++]] = key;
        }
}
