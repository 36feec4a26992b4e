// Written by `python -m gsac.viewer.wgsl` from the HLSL of the Unity package and page.hlsl. Do not edit.
// glslang 11, naga-wasm@30.1.0, HLSL e4be239382e9952cc7bd2eabf98e6e2f831e144235f6a3c167a55c7020a163cd

export const SHADERS = {
  Skin: { bindings: {"parameters": 0, "GsacSkin": 2, "GsacRest": 1, "GsacMoves": 3, "GsacWeights": 4, "GsacBones": 5, "GsacPosed": 6}, parameters: {"GsacVertexCount": 0, "GsacSplatCount": 4, "GsacIndexBits": 8, "GsacSortStage": 12, "GsacSortShift": 16, "GsacSortStrides": 20, "GsacDepthRange": 24, "GsacDepthRow": 32, "GsacLightRed": 48, "GsacLightGreen": 64, "GsacLightBlue": 80, "GsacSceneRed": 96, "GsacSceneGreen": 112, "GsacSceneBlue": 128, "GsacSceneRed2": 144, "GsacSceneGreen2": 160, "GsacSceneBlue2": 176, "GsacSceneLast": 192}, code: `
struct GsacParams {
GsacVertexCount: u32,
GsacSplatCount: u32,
GsacIndexBits: u32,
GsacSortStage: u32,
GsacSortShift: u32,
GsacSortStrides: u32,
GsacDepthRange: vec2<f32>,
GsacDepthRow: vec4<f32>,
GsacLightRed: vec4<f32>,
GsacLightGreen: vec4<f32>,
GsacLightBlue: vec4<f32>,
GsacSceneRed: vec4<f32>,
GsacSceneGreen: vec4<f32>,
GsacSceneBlue: vec4<f32>,
GsacSceneRed2_: vec4<f32>,
GsacSceneGreen2_: vec4<f32>,
GsacSceneBlue2_: vec4<f32>,
GsacSceneLast: vec4<f32>,
}

struct GsacSkin {
data: array<vec4<u32>>,
}

struct GsacRest {
data: array<vec4<f32>>,
}

struct GsacWeights {
data: array<f32>,
}

struct GsacPosed {
data: array<vec4<f32>>,
}

@group(0) @binding(0)
var<uniform> unnamed: GsacParams;
@group(0) @binding(2)
var<storage> GsacSkin_1: GsacSkin;
@group(0) @binding(1)
var<storage> GsacRest_1: GsacRest;
@group(0) @binding(3)
var<storage> GsacMoves: GsacRest;
@group(0) @binding(4)
var<storage> GsacWeights_1: GsacWeights;
@group(0) @binding(5)
var<storage> GsacBones: GsacRest;
@group(0) @binding(6)
var<storage, read_write> GsacPosed_1: GsacPosed;
var<private> id_1: vec3<u32>;

fn Skin_1() {
var phi_353_: vec3<f32>;
var phi_349_: u32;
var phi_351_: vec3<f32>;
var phi_350_: u32;
var local: vec3<f32>;
var local_1: vec3<f32>;
var local_2: vec3<f32>;
var local_3: vec3<f32>;
var local_4: vec3<f32>;
var local_5: vec3<f32>;

let _e23 = id_1;
switch bitcast<i32>(0u) {
default: {
let _e27 = unnamed.GsacVertexCount;
if (_e23.x >= _e27) {
break;
}
let _e31 = GsacSkin_1.data[_e23.x];
let _e34 = GsacRest_1.data[_e23.x];
let _e40 = GsacSkin_1.data[(_e23.x + 1u)][3u];
phi_353_ = _e34.xyz;
phi_349_ = _e31.w;
loop {
let _e43 = phi_353_;
let _e45 = phi_349_;
local = _e43;
local_1 = _e43;
local_2 = _e43;
if (_e45 < _e40) {
continue;
} else {
break;
}
continuing {
let _e49 = GsacMoves.data[_e45];
let _e54 = GsacWeights_1.data[u32(_e49.w)];
phi_353_ = (_e43 + (_e49.xyz * _e54));
phi_349_ = (_e45 + bitcast<u32>(1i));
}
}
phi_351_ = vec3<f32>(0f, 0f, 0f);
phi_350_ = 0u;
loop {
let _e61 = phi_351_;
let _e63 = phi_350_;
local_3 = _e61;
local_4 = _e61;
local_5 = _e61;
if (_e63 < 4u) {
continue;
} else {
break;
}
continuing {
let _e70 = (((_e31.x >> bitcast<u32>((8u * _e63))) & 255u) * 3u);
let _e83 = local;
let _e86 = local_1;
let _e89 = local_2;
let _e91 = vec4<f32>(_e83.x, _e86.y, _e89.z, 1f);
let _e94 = GsacBones.data[_e70];
let _e99 = GsacBones.data[(_e70 + 1u)];
let _e104 = GsacBones.data[(_e70 + 2u)];
phi_351_ = (_e61 + (vec3<f32>(dot(_e94, _e91), dot(_e99, _e91), dot(_e104, _e91)) * (f32(((select(_e31.z, _e31.y, (_e63 < 2u)) >> bitcast<u32>((16u * (_e63 & 1u)))) & 65535u)) * 0.000015259022f)));
phi_350_ = (_e63 + bitcast<u32>(1i));
}
}
let _e112 = local_3;
let _e115 = local_4;
let _e118 = local_5;
GsacPosed_1.data[_e23.x] = vec4<f32>(_e112.x, _e115.y, _e118.z, 1f);
break;
}
}
return;
}

@compute @workgroup_size(64, 1, 1)
fn Skin(@builtin(global_invocation_id) id: vec3<u32>) {
id_1 = id;
Skin_1();
}
` },
  Bind: { bindings: {"parameters": 0, "GsacCorners": 2, "GsacPosed": 1, "GsacLocal": 3, "GsacSplats": 4}, parameters: {"GsacVertexCount": 0, "GsacSplatCount": 4, "GsacIndexBits": 8, "GsacSortStage": 12, "GsacSortShift": 16, "GsacSortStrides": 20, "GsacDepthRange": 24, "GsacDepthRow": 32, "GsacLightRed": 48, "GsacLightGreen": 64, "GsacLightBlue": 80, "GsacSceneRed": 96, "GsacSceneGreen": 112, "GsacSceneBlue": 128, "GsacSceneRed2": 144, "GsacSceneGreen2": 160, "GsacSceneBlue2": 176, "GsacSceneLast": 192}, code: `
struct GsacParams {
GsacVertexCount: u32,
GsacSplatCount: u32,
GsacIndexBits: u32,
GsacSortStage: u32,
GsacSortShift: u32,
GsacSortStrides: u32,
GsacDepthRange: vec2<f32>,
GsacDepthRow: vec4<f32>,
GsacLightRed: vec4<f32>,
GsacLightGreen: vec4<f32>,
GsacLightBlue: vec4<f32>,
GsacSceneRed: vec4<f32>,
GsacSceneGreen: vec4<f32>,
GsacSceneBlue: vec4<f32>,
GsacSceneRed2_: vec4<f32>,
GsacSceneGreen2_: vec4<f32>,
GsacSceneBlue2_: vec4<f32>,
GsacSceneLast: vec4<f32>,
}

struct GsacCorners {
data: array<vec4<u32>>,
}

struct GsacPosed {
data: array<vec4<f32>>,
}

struct GsacLocal {
data: array<vec4<f32>>,
}

@group(0) @binding(0)
var<uniform> unnamed: GsacParams;
@group(0) @binding(2)
var<storage> GsacCorners_1: GsacCorners;
@group(0) @binding(1)
var<storage, read_write> GsacPosed_1: GsacPosed;
@group(0) @binding(3)
var<storage> GsacLocal_1: GsacLocal;
@group(0) @binding(4)
var<storage, read_write> GsacSplats: GsacPosed;
var<private> id_1: vec3<u32>;

fn Bind_1() {
var phi_1602_: vec3<f32>;
var phi_1601_: vec3<f32>;
var phi_1600_: vec3<f32>;
var phi_1599_: f32;
var phi_1603_: vec3<f32>;

let _e41 = id_1;
switch bitcast<i32>(0u) {
default: {
let _e45 = unnamed.GsacSplatCount;
if (_e41.x >= _e45) {
break;
}
let _e49 = GsacCorners_1.data[_e41.x];
let _e55 = GsacPosed_1.data[_e49.x];
let _e59 = GsacPosed_1.data[_e49.y];
let _e60 = _e59.xyz;
let _e63 = GsacPosed_1.data[_e49.z];
let _e65 = (_e63.xyz - _e60);
let _e66 = (_e55.xyz - _e60);
let _e67 = cross(_e65, _e66);
let _e68 = length(_e67);
phi_1602_ = vec3<f32>(1f, 0f, 0f);
phi_1601_ = vec3<f32>(0f, 1f, 0f);
phi_1600_ = vec3<f32>(0f, 0f, 1f);
phi_1599_ = 0f;
if ((_e68 > (0.000001f * (dot(_e65, _e65) + dot(_e66, _e66)))) && (_e68 > 0.000000000000001f)) {
let _e80 = length((_e66 - _e65));
let _e83 = (_e65 / vec3(length(_e65)));
let _e85 = (_e67 / vec3(_e68));
phi_1602_ = _e83;
phi_1601_ = _e85;
phi_1600_ = cross(_e83, _e85);
phi_1599_ = (10f * ((_e68 / _e80) + _e80));
}
let _e91 = phi_1602_;
let _e93 = phi_1601_;
let _e95 = phi_1600_;
let _e97 = phi_1599_;
let _e105 = GsacLocal_1.data[(_e41.x * 3u)];
let _e108 = GsacLocal_1.data[((_e41.x * 3u) + 1u)];
let _e111 = GsacLocal_1.data[((_e41.x * 3u) + 2u)];
let _e183 = ((_e60 + ((_e65 + _e66) * 0.33333334f)) + ((((_e91 * _e105.x) + (_e93 * _e105.y)) + (_e95 * _e105.z)) * _e97));
let _e199 = (_e111.xyz * _e97);
let _e201 = ((((_e91 * fma(-2f, fma(_e108.y, _e108.y, (_e108.z * _e108.z)), 1f)) + (_e93 * (2f * fma(_e108.x, _e108.y, (_e108.w * _e108.z))))) + (_e95 * (2f * fma(_e108.x, _e108.z, -((_e108.w * _e108.y)))))) * _e199.x);
let _e203 = ((((_e91 * (2f * fma(_e108.x, _e108.y, -((_e108.w * _e108.z))))) + (_e93 * fma(-2f, fma(_e108.x, _e108.x, (_e108.z * _e108.z)), 1f))) + (_e95 * (2f * fma(_e108.y, _e108.z, (_e108.w * _e108.x))))) * _e199.y);
let _e205 = ((((_e91 * (2f * fma(_e108.x, _e108.z, (_e108.w * _e108.y)))) + (_e93 * (2f * fma(_e108.y, _e108.z, -((_e108.w * _e108.x)))))) + (_e95 * fma(-2f, fma(_e108.x, _e108.x, (_e108.y * _e108.y)), 1f))) * _e199.z);
let _e208 = fma(_e205, _e205, fma(_e201, _e201, (_e203 * _e203)));
let _e217 = fma(_e205.xxy, _e205.yzz, fma(_e201.xxy, _e201.yzz, (_e203.xxy * _e203.yzz)));
GsacSplats.data[(_e41.x * 3u)] = vec4<f32>(_e183.x, _e183.y, _e183.z, _e208.x);
GsacSplats.data[((_e41.x * 3u) + 1u)] = vec4<f32>(_e208.y, _e208.z, _e217.x, _e217.y);
let _e236 = unnamed.GsacSceneRed;
let _e238 = unnamed.GsacSceneGreen;
let _e240 = unnamed.GsacSceneBlue;
let _e242 = unnamed.GsacSceneRed2_;
let _e244 = unnamed.GsacSceneGreen2_;
let _e246 = unnamed.GsacSceneBlue2_;
let _e248 = unnamed.GsacSceneLast;
let _e250 = unnamed.GsacLightRed;
let _e252 = unnamed.GsacLightGreen;
let _e254 = unnamed.GsacLightBlue;
let _e262 = select(vec3<f32>(0f, 0f, 0f), vec3<f32>(_e93.x, _e93.y, abs(_e93.z)), vec3((_e97 > 0f)));
let _e266 = vec4<f32>(_e262.x, _e262.y, _e262.z, 1f);
let _e271 = clamp(vec3<f32>(dot(_e250, _e266), dot(_e252, _e266), dot(_e254, _e266)), vec3<f32>(0.25f, 0.25f, 0.25f), vec3<f32>(2.5f, 2.5f, 2.5f));
phi_1603_ = _e271;
if (_e248.w > 0f) {
let _e276 = select(vec3<f32>(0f, 0f, 0f), _e93, vec3((_e97 > 0f)));
let _e280 = vec4<f32>(_e276.x, _e276.y, _e276.z, 1f);
let _e283 = (_e276.xyzz * _e276.yzzx);
phi_1603_ = mix(_e271, min(pow(max(((vec3<f32>(dot(_e236, _e280), dot(_e238, _e280), dot(_e240, _e280)) + vec3<f32>(dot(_e242, _e283), dot(_e244, _e283), dot(_e246, _e283))) + (_e248.xyz * fma(_e276.x, _e276.x, -((_e276.y * _e276.y))))), vec3<f32>(0.000001f, 0.000001f, 0.000001f)), vec3<f32>(0.45454547f, 0.45454547f, 0.45454547f)), vec3<f32>(2.5f, 2.5f, 2.5f)), vec3(_e248.w));
}
let _e310 = phi_1603_;
GsacSplats.data[((_e41.x * 3u) + 2u)] = vec4<f32>(_e217.z, _e310.x, _e310.y, _e310.z);
break;
}
}
return;
}

@compute @workgroup_size(64, 1, 1)
fn Bind(@builtin(global_invocation_id) id: vec3<u32>) {
id_1 = id;
Bind_1();
}
` },
  SortBlocks: { bindings: {"parameters": 0, "GsacSplats": 1, "GsacKeys": 2}, parameters: {"GsacVertexCount": 0, "GsacSplatCount": 4, "GsacIndexBits": 8, "GsacSortStage": 12, "GsacSortShift": 16, "GsacSortStrides": 20, "GsacDepthRange": 24, "GsacDepthRow": 32, "GsacLightRed": 48, "GsacLightGreen": 64, "GsacLightBlue": 80, "GsacSceneRed": 96, "GsacSceneGreen": 112, "GsacSceneBlue": 128, "GsacSceneRed2": 144, "GsacSceneGreen2": 160, "GsacSceneBlue2": 176, "GsacSceneLast": 192}, code: `
struct GsacParams {
GsacVertexCount: u32,
GsacSplatCount: u32,
GsacIndexBits: u32,
GsacSortStage: u32,
GsacSortShift: u32,
GsacSortStrides: u32,
GsacDepthRange: vec2<f32>,
GsacDepthRow: vec4<f32>,
GsacLightRed: vec4<f32>,
GsacLightGreen: vec4<f32>,
GsacLightBlue: vec4<f32>,
GsacSceneRed: vec4<f32>,
GsacSceneGreen: vec4<f32>,
GsacSceneBlue: vec4<f32>,
GsacSceneRed2_: vec4<f32>,
GsacSceneGreen2_: vec4<f32>,
GsacSceneBlue2_: vec4<f32>,
GsacSceneLast: vec4<f32>,
}

struct GsacSplats {
data: array<vec4<f32>>,
}

struct GsacKeys {
data: array<u32>,
}

@group(0) @binding(0)
var<uniform> unnamed: GsacParams;
@group(0) @binding(1)
var<storage, read_write> GsacSplats_1: GsacSplats;
var<workgroup> shared_keys: array<u32, 4096>;
@group(0) @binding(2)
var<storage, read_write> GsacKeys_1: GsacKeys;
var<private> group_1: vec3<u32>;
var<private> id_1: vec3<u32>;

fn SortBlocks_1() {
var phi_4726_: u32;
var phi_4751_: u32;
var phi_4727_: u32;
var phi_4729_: u32;
var phi_4734_: vec4<u32>;
var phi_4733_: vec4<u32>;
var phi_4732_: vec4<u32>;
var phi_4731_: vec4<u32>;
var phi_4738_: vec4<u32>;
var phi_4737_: vec4<u32>;
var phi_4736_: vec4<u32>;
var phi_4735_: vec4<u32>;
var phi_4742_: vec4<u32>;
var phi_4741_: vec4<u32>;
var phi_4740_: vec4<u32>;
var phi_4739_: vec4<u32>;
var phi_4746_: vec4<u32>;
var phi_4745_: vec4<u32>;
var phi_4744_: vec4<u32>;
var phi_4743_: vec4<u32>;
var phi_4728_: u32;
var local: u32;

let _e40 = group_1;
let _e41 = id_1;
let _e43 = (_e40.x * 4096u);
phi_4726_ = 0u;
loop {
let _e45 = phi_4726_;
if (_e45 < 4096u) {
let _e48 = (_e45 + _e41.x);
let _e55 = ((_e43 + _e45) + _e41.x);
switch bitcast<i32>(0u) {
default: {
let _e58 = unnamed.GsacSplatCount;
if (_e55 >= _e58) {
phi_4751_ = 4294967295u;
break;
}
let _e61 = unnamed.GsacDepthRow;
let _e66 = GsacSplats_1.data[(_e55 * 3u)];
let _e71 = unnamed.GsacDepthRow[3u];
let _e74 = unnamed.GsacDepthRange;
let _e76 = unnamed.GsacIndexBits;
let _e80 = (exp2((32f - f32(_e76))) - 1f);
phi_4751_ = ((u32((_e80 - floor((clamp((((dot(_e61.xyz, _e66.xyz) + _e71) - _e74.x) * _e74.y), 0f, 1f) * _e80)))) << bitcast<u32>(_e76)) | _e55);
break;
}
}
let _e94 = phi_4751_;
shared_keys[(_e48 ^ ((_e48 >> bitcast<u32>(4i)) & 15u))] = _e94;
continue;
} else {
break;
}
continuing {
phi_4726_ = (_e45 + 256u);
}
}
workgroupBarrier();
let _e98 = (_e41.x * 16u);
let _e104 = shared_keys[(_e98 ^ ((_e98 >> bitcast<u32>(4i)) & 15u))];
let _e105 = (_e98 + 1u);
let _e111 = shared_keys[(_e105 ^ ((_e105 >> bitcast<u32>(4i)) & 15u))];
let _e112 = (_e98 + 2u);
let _e118 = shared_keys[(_e112 ^ ((_e112 >> bitcast<u32>(4i)) & 15u))];
let _e119 = (_e98 + 3u);
let _e125 = shared_keys[(_e119 ^ ((_e119 >> bitcast<u32>(4i)) & 15u))];
let _e127 = (_e98 + 4u);
let _e133 = shared_keys[(_e127 ^ ((_e127 >> bitcast<u32>(4i)) & 15u))];
let _e134 = (_e98 + 5u);
let _e140 = shared_keys[(_e134 ^ ((_e134 >> bitcast<u32>(4i)) & 15u))];
let _e141 = (_e98 + 6u);
let _e147 = shared_keys[(_e141 ^ ((_e141 >> bitcast<u32>(4i)) & 15u))];
let _e148 = (_e98 + 7u);
let _e154 = shared_keys[(_e148 ^ ((_e148 >> bitcast<u32>(4i)) & 15u))];
let _e156 = (_e98 + 8u);
let _e162 = shared_keys[(_e156 ^ ((_e156 >> bitcast<u32>(4i)) & 15u))];
let _e163 = (_e98 + 9u);
let _e169 = shared_keys[(_e163 ^ ((_e163 >> bitcast<u32>(4i)) & 15u))];
let _e170 = (_e98 + 10u);
let _e176 = shared_keys[(_e170 ^ ((_e170 >> bitcast<u32>(4i)) & 15u))];
let _e177 = (_e98 + 11u);
let _e183 = shared_keys[(_e177 ^ ((_e177 >> bitcast<u32>(4i)) & 15u))];
let _e185 = (_e98 + 12u);
let _e191 = shared_keys[(_e185 ^ ((_e185 >> bitcast<u32>(4i)) & 15u))];
let _e192 = (_e98 + 13u);
let _e198 = shared_keys[(_e192 ^ ((_e192 >> bitcast<u32>(4i)) & 15u))];
let _e199 = (_e98 + 14u);
let _e205 = shared_keys[(_e199 ^ ((_e199 >> bitcast<u32>(4i)) & 15u))];
let _e206 = (_e98 + 15u);
let _e212 = shared_keys[(_e206 ^ ((_e206 >> bitcast<u32>(4i)) & 15u))];
let _e214 = (vec4<u32>(_e104, _e111, _e118, _e125) ^ vec4<u32>(0u, 0u, 4294967295u, 4294967295u));
let _e215 = (vec4<u32>(_e133, _e140, _e147, _e154) ^ vec4<u32>(0u, 0u, 4294967295u, 4294967295u));
let _e216 = (vec4<u32>(_e162, _e169, _e176, _e183) ^ vec4<u32>(0u, 0u, 4294967295u, 4294967295u));
let _e217 = (vec4<u32>(_e191, _e198, _e205, _e212) ^ vec4<u32>(0u, 0u, 4294967295u, 4294967295u));
let _e220 = min(_e214.xz, _e214.yw);
let _e223 = max(_e214.xz, _e214.yw);
let _e231 = min(_e215.xz, _e215.yw);
let _e234 = max(_e215.xz, _e215.yw);
let _e242 = min(_e216.xz, _e216.yw);
let _e245 = max(_e216.xz, _e216.yw);
let _e253 = min(_e217.xz, _e217.yw);
let _e256 = max(_e217.xz, _e217.yw);
let _e266 = ((vec4<u32>(_e220.x, _e223.x, _e220.y, _e223.y) ^ vec4<u32>(0u, 0u, 4294967295u, 4294967295u)) ^ vec4<u32>(0u, 0u, 0u, 0u));
let _e267 = ((vec4<u32>(_e231.x, _e234.x, _e231.y, _e234.y) ^ vec4<u32>(0u, 0u, 4294967295u, 4294967295u)) ^ vec4<u32>(4294967295u, 4294967295u, 4294967295u, 4294967295u));
let _e268 = ((vec4<u32>(_e242.x, _e245.x, _e242.y, _e245.y) ^ vec4<u32>(0u, 0u, 4294967295u, 4294967295u)) ^ vec4<u32>(0u, 0u, 0u, 0u));
let _e269 = ((vec4<u32>(_e253.x, _e256.x, _e253.y, _e256.y) ^ vec4<u32>(0u, 0u, 4294967295u, 4294967295u)) ^ vec4<u32>(4294967295u, 4294967295u, 4294967295u, 4294967295u));
let _e272 = min(_e266.xy, _e266.zw);
let _e275 = max(_e266.xy, _e266.zw);
let _e280 = vec4<u32>(_e272.x, _e272.y, _e275.x, _e275.y);
let _e283 = min(_e267.xy, _e267.zw);
let _e286 = max(_e267.xy, _e267.zw);
let _e291 = vec4<u32>(_e283.x, _e283.y, _e286.x, _e286.y);
let _e294 = min(_e268.xy, _e268.zw);
let _e297 = max(_e268.xy, _e268.zw);
let _e302 = vec4<u32>(_e294.x, _e294.y, _e297.x, _e297.y);
let _e305 = min(_e269.xy, _e269.zw);
let _e308 = max(_e269.xy, _e269.zw);
let _e313 = vec4<u32>(_e305.x, _e305.y, _e308.x, _e308.y);
let _e316 = min(_e280.xz, _e280.yw);
let _e319 = max(_e280.xz, _e280.yw);
let _e327 = min(_e291.xz, _e291.yw);
let _e330 = max(_e291.xz, _e291.yw);
let _e338 = min(_e302.xz, _e302.yw);
let _e341 = max(_e302.xz, _e302.yw);
let _e349 = min(_e313.xz, _e313.yw);
let _e352 = max(_e313.xz, _e313.yw);
let _e362 = ((vec4<u32>(_e316.x, _e319.x, _e316.y, _e319.y) ^ vec4<u32>(0u, 0u, 0u, 0u)) ^ vec4<u32>(0u, 0u, 0u, 0u));
let _e363 = ((vec4<u32>(_e327.x, _e330.x, _e327.y, _e330.y) ^ vec4<u32>(4294967295u, 4294967295u, 4294967295u, 4294967295u)) ^ vec4<u32>(0u, 0u, 0u, 0u));
let _e364 = ((vec4<u32>(_e338.x, _e341.x, _e338.y, _e341.y) ^ vec4<u32>(0u, 0u, 0u, 0u)) ^ vec4<u32>(4294967295u, 4294967295u, 4294967295u, 4294967295u));
let _e365 = ((vec4<u32>(_e349.x, _e352.x, _e349.y, _e352.y) ^ vec4<u32>(4294967295u, 4294967295u, 4294967295u, 4294967295u)) ^ vec4<u32>(4294967295u, 4294967295u, 4294967295u, 4294967295u));
let _e366 = min(_e362, _e363);
let _e367 = max(_e362, _e363);
let _e368 = min(_e364, _e365);
let _e369 = max(_e364, _e365);
let _e372 = min(_e366.xy, _e366.zw);
let _e375 = max(_e366.xy, _e366.zw);
let _e380 = vec4<u32>(_e372.x, _e372.y, _e375.x, _e375.y);
let _e383 = min(_e367.xy, _e367.zw);
let _e386 = max(_e367.xy, _e367.zw);
let _e391 = vec4<u32>(_e383.x, _e383.y, _e386.x, _e386.y);
let _e394 = min(_e368.xy, _e368.zw);
let _e397 = max(_e368.xy, _e368.zw);
let _e402 = vec4<u32>(_e394.x, _e394.y, _e397.x, _e397.y);
let _e405 = min(_e369.xy, _e369.zw);
let _e408 = max(_e369.xy, _e369.zw);
let _e413 = vec4<u32>(_e405.x, _e405.y, _e408.x, _e408.y);
let _e416 = min(_e380.xz, _e380.yw);
let _e419 = max(_e380.xz, _e380.yw);
let _e427 = min(_e391.xz, _e391.yw);
let _e430 = max(_e391.xz, _e391.yw);
let _e438 = min(_e402.xz, _e402.yw);
let _e441 = max(_e402.xz, _e402.yw);
let _e449 = min(_e413.xz, _e413.yw);
let _e452 = max(_e413.xz, _e413.yw);
let _e466 = select(vec4<u32>(4294967295u, 4294967295u, 4294967295u, 4294967295u), vec4<u32>(0u, 0u, 0u, 0u), vec4((((_e43 + _e98) & 16u) == 0u)));
let _e467 = ((vec4<u32>(_e416.x, _e419.x, _e416.y, _e419.y) ^ vec4<u32>(0u, 0u, 0u, 0u)) ^ _e466);
let _e468 = ((vec4<u32>(_e427.x, _e430.x, _e427.y, _e430.y) ^ vec4<u32>(0u, 0u, 0u, 0u)) ^ _e466);
let _e469 = ((vec4<u32>(_e438.x, _e441.x, _e438.y, _e441.y) ^ vec4<u32>(4294967295u, 4294967295u, 4294967295u, 4294967295u)) ^ _e466);
let _e470 = ((vec4<u32>(_e449.x, _e452.x, _e449.y, _e452.y) ^ vec4<u32>(4294967295u, 4294967295u, 4294967295u, 4294967295u)) ^ _e466);
let _e471 = min(_e467, _e469);
let _e472 = max(_e467, _e469);
let _e473 = min(_e468, _e470);
let _e474 = max(_e468, _e470);
let _e475 = min(_e471, _e473);
let _e476 = max(_e471, _e473);
let _e477 = min(_e472, _e474);
let _e478 = max(_e472, _e474);
let _e481 = min(_e475.xy, _e475.zw);
let _e484 = max(_e475.xy, _e475.zw);
let _e489 = vec4<u32>(_e481.x, _e481.y, _e484.x, _e484.y);
let _e492 = min(_e476.xy, _e476.zw);
let _e495 = max(_e476.xy, _e476.zw);
let _e500 = vec4<u32>(_e492.x, _e492.y, _e495.x, _e495.y);
let _e503 = min(_e477.xy, _e477.zw);
let _e506 = max(_e477.xy, _e477.zw);
let _e511 = vec4<u32>(_e503.x, _e503.y, _e506.x, _e506.y);
let _e514 = min(_e478.xy, _e478.zw);
let _e517 = max(_e478.xy, _e478.zw);
let _e522 = vec4<u32>(_e514.x, _e514.y, _e517.x, _e517.y);
let _e525 = min(_e489.xz, _e489.yw);
let _e528 = max(_e489.xz, _e489.yw);
let _e536 = min(_e500.xz, _e500.yw);
let _e539 = max(_e500.xz, _e500.yw);
let _e547 = min(_e511.xz, _e511.yw);
let _e550 = max(_e511.xz, _e511.yw);
let _e558 = min(_e522.xz, _e522.yw);
let _e561 = max(_e522.xz, _e522.yw);
let _e567 = (vec4<u32>(_e525.x, _e528.x, _e525.y, _e528.y) ^ _e466);
let _e568 = (vec4<u32>(_e536.x, _e539.x, _e536.y, _e539.y) ^ _e466);
let _e569 = (vec4<u32>(_e547.x, _e550.x, _e547.y, _e550.y) ^ _e466);
let _e570 = (vec4<u32>(_e558.x, _e561.x, _e558.y, _e561.y) ^ _e466);
shared_keys[(_e98 ^ ((_e98 >> bitcast<u32>(4i)) & 15u))] = _e567.x;
let _e577 = (_e98 + 1u);
shared_keys[(_e577 ^ ((_e577 >> bitcast<u32>(4i)) & 15u))] = _e567.y;
let _e584 = (_e98 + 2u);
shared_keys[(_e584 ^ ((_e584 >> bitcast<u32>(4i)) & 15u))] = _e567.z;
let _e591 = (_e98 + 3u);
shared_keys[(_e591 ^ ((_e591 >> bitcast<u32>(4i)) & 15u))] = _e567.w;
let _e598 = (_e98 + 4u);
shared_keys[(_e598 ^ ((_e598 >> bitcast<u32>(4i)) & 15u))] = _e568.x;
let _e605 = (_e98 + 5u);
shared_keys[(_e605 ^ ((_e605 >> bitcast<u32>(4i)) & 15u))] = _e568.y;
let _e612 = (_e98 + 6u);
shared_keys[(_e612 ^ ((_e612 >> bitcast<u32>(4i)) & 15u))] = _e568.z;
let _e619 = (_e98 + 7u);
shared_keys[(_e619 ^ ((_e619 >> bitcast<u32>(4i)) & 15u))] = _e568.w;
let _e626 = (_e98 + 8u);
shared_keys[(_e626 ^ ((_e626 >> bitcast<u32>(4i)) & 15u))] = _e569.x;
let _e633 = (_e98 + 9u);
shared_keys[(_e633 ^ ((_e633 >> bitcast<u32>(4i)) & 15u))] = _e569.y;
let _e640 = (_e98 + 10u);
shared_keys[(_e640 ^ ((_e640 >> bitcast<u32>(4i)) & 15u))] = _e569.z;
let _e647 = (_e98 + 11u);
shared_keys[(_e647 ^ ((_e647 >> bitcast<u32>(4i)) & 15u))] = _e569.w;
let _e654 = (_e98 + 12u);
shared_keys[(_e654 ^ ((_e654 >> bitcast<u32>(4i)) & 15u))] = _e570.x;
let _e661 = (_e98 + 13u);
shared_keys[(_e661 ^ ((_e661 >> bitcast<u32>(4i)) & 15u))] = _e570.y;
let _e668 = (_e98 + 14u);
shared_keys[(_e668 ^ ((_e668 >> bitcast<u32>(4i)) & 15u))] = _e570.z;
let _e675 = (_e98 + 15u);
shared_keys[(_e675 ^ ((_e675 >> bitcast<u32>(4i)) & 15u))] = _e570.w;
workgroupBarrier();
phi_4727_ = 5u;
loop {
let _e683 = phi_4727_;
if (_e683 <= 12u) {
phi_4729_ = _e683;
loop {
let _e689 = phi_4729_;
if (_e689 > 0u) {
let _e693 = (((_e689 - 1u) & 3u) + 1u);
let _e694 = (_e689 - 4u);
let _e703 = (((_e41.x >> bitcast<u32>(_e694)) << bitcast<u32>(_e689)) | (_e41.x & ((1u << bitcast<u32>(_e694)) - 1u)));
let _e705 = (1u << bitcast<u32>(_e694));
let _e711 = shared_keys[(_e703 ^ ((_e703 >> bitcast<u32>(4i)) & 15u))];
let _e712 = (_e703 + _e705);
let _e718 = shared_keys[(_e712 ^ ((_e712 >> bitcast<u32>(4i)) & 15u))];
let _e720 = (_e703 + (2u * _e705));
let _e726 = shared_keys[(_e720 ^ ((_e720 >> bitcast<u32>(4i)) & 15u))];
let _e728 = (_e703 + (3u * _e705));
let _e734 = shared_keys[(_e728 ^ ((_e728 >> bitcast<u32>(4i)) & 15u))];
let _e737 = (_e703 + (4u * _e705));
let _e743 = shared_keys[(_e737 ^ ((_e737 >> bitcast<u32>(4i)) & 15u))];
let _e744 = (_e737 + _e705);
let _e750 = shared_keys[(_e744 ^ ((_e744 >> bitcast<u32>(4i)) & 15u))];
let _e752 = (_e737 + (2u * _e705));
let _e758 = shared_keys[(_e752 ^ ((_e752 >> bitcast<u32>(4i)) & 15u))];
let _e760 = (_e737 + (3u * _e705));
let _e766 = shared_keys[(_e760 ^ ((_e760 >> bitcast<u32>(4i)) & 15u))];
let _e769 = (_e703 + (8u * _e705));
let _e775 = shared_keys[(_e769 ^ ((_e769 >> bitcast<u32>(4i)) & 15u))];
let _e776 = (_e769 + _e705);
let _e782 = shared_keys[(_e776 ^ ((_e776 >> bitcast<u32>(4i)) & 15u))];
let _e784 = (_e769 + (2u * _e705));
let _e790 = shared_keys[(_e784 ^ ((_e784 >> bitcast<u32>(4i)) & 15u))];
let _e792 = (_e769 + (3u * _e705));
let _e798 = shared_keys[(_e792 ^ ((_e792 >> bitcast<u32>(4i)) & 15u))];
let _e801 = (_e703 + (12u * _e705));
let _e807 = shared_keys[(_e801 ^ ((_e801 >> bitcast<u32>(4i)) & 15u))];
let _e808 = (_e801 + _e705);
let _e814 = shared_keys[(_e808 ^ ((_e808 >> bitcast<u32>(4i)) & 15u))];
let _e816 = (_e801 + (2u * _e705));
let _e822 = shared_keys[(_e816 ^ ((_e816 >> bitcast<u32>(4i)) & 15u))];
let _e824 = (_e801 + (3u * _e705));
let _e830 = shared_keys[(_e824 ^ ((_e824 >> bitcast<u32>(4i)) & 15u))];
let _e835 = bitcast<u32>((15i ^ (15i >> bitcast<u32>(_e693))));
let _e840 = select(vec4<u32>(4294967295u, 4294967295u, 4294967295u, 4294967295u), vec4<u32>(0u, 0u, 0u, 0u), vec4((((_e43 + _e703) & (1u << bitcast<u32>(_e683))) == 0u)));
let _e841 = (vec4<u32>(_e711, _e718, _e726, _e734) ^ _e840);
let _e842 = (vec4<u32>(_e743, _e750, _e758, _e766) ^ _e840);
let _e843 = (vec4<u32>(_e775, _e782, _e790, _e798) ^ _e840);
let _e844 = (vec4<u32>(_e807, _e814, _e822, _e830) ^ _e840);
phi_4734_ = _e844;
phi_4733_ = _e843;
phi_4732_ = _e842;
phi_4731_ = _e841;
if ((_e835 & 8u) != 0u) {
phi_4734_ = max(_e842, _e844);
phi_4733_ = max(_e841, _e843);
phi_4732_ = min(_e842, _e844);
phi_4731_ = min(_e841, _e843);
}
let _e852 = phi_4734_;
let _e854 = phi_4733_;
let _e856 = phi_4732_;
let _e858 = phi_4731_;
phi_4738_ = _e852;
phi_4737_ = _e854;
phi_4736_ = _e856;
phi_4735_ = _e858;
if ((_e835 & 4u) != 0u) {
phi_4738_ = max(_e854, _e852);
phi_4737_ = min(_e854, _e852);
phi_4736_ = max(_e858, _e856);
phi_4735_ = min(_e858, _e856);
}
let _e866 = phi_4738_;
let _e868 = phi_4737_;
let _e870 = phi_4736_;
let _e872 = phi_4735_;
phi_4742_ = _e866;
phi_4741_ = _e868;
phi_4740_ = _e870;
phi_4739_ = _e872;
if ((_e835 & 2u) != 0u) {
let _e877 = min(_e872.xy, _e872.zw);
let _e880 = max(_e872.xy, _e872.zw);
let _e888 = min(_e870.xy, _e870.zw);
let _e891 = max(_e870.xy, _e870.zw);
let _e899 = min(_e868.xy, _e868.zw);
let _e902 = max(_e868.xy, _e868.zw);
let _e910 = min(_e866.xy, _e866.zw);
let _e913 = max(_e866.xy, _e866.zw);
phi_4742_ = vec4<u32>(_e910.x, _e910.y, _e913.x, _e913.y);
phi_4741_ = vec4<u32>(_e899.x, _e899.y, _e902.x, _e902.y);
phi_4740_ = vec4<u32>(_e888.x, _e888.y, _e891.x, _e891.y);
phi_4739_ = vec4<u32>(_e877.x, _e877.y, _e880.x, _e880.y);
}
let _e920 = phi_4742_;
let _e922 = phi_4741_;
let _e924 = phi_4740_;
let _e926 = phi_4739_;
phi_4746_ = _e926;
phi_4745_ = _e924;
phi_4744_ = _e922;
phi_4743_ = _e920;
if ((_e835 & 1u) != 0u) {
let _e931 = min(_e926.xz, _e926.yw);
let _e934 = max(_e926.xz, _e926.yw);
let _e942 = min(_e924.xz, _e924.yw);
let _e945 = max(_e924.xz, _e924.yw);
let _e953 = min(_e922.xz, _e922.yw);
let _e956 = max(_e922.xz, _e922.yw);
let _e964 = min(_e920.xz, _e920.yw);
let _e967 = max(_e920.xz, _e920.yw);
phi_4746_ = vec4<u32>(_e931.x, _e934.x, _e931.y, _e934.y);
phi_4745_ = vec4<u32>(_e942.x, _e945.x, _e942.y, _e945.y);
phi_4744_ = vec4<u32>(_e953.x, _e956.x, _e953.y, _e956.y);
phi_4743_ = vec4<u32>(_e964.x, _e967.x, _e964.y, _e967.y);
}
let _e974 = phi_4746_;
let _e976 = phi_4745_;
let _e978 = phi_4744_;
let _e980 = phi_4743_;
let _e981 = (_e974 ^ _e840);
let _e982 = (_e976 ^ _e840);
let _e983 = (_e978 ^ _e840);
let _e984 = (_e980 ^ _e840);
let _e986 = (1u << bitcast<u32>(_e694));
shared_keys[(_e703 ^ ((_e703 >> bitcast<u32>(4i)) & 15u))] = _e981.x;
let _e993 = (_e703 + _e986);
shared_keys[(_e993 ^ ((_e993 >> bitcast<u32>(4i)) & 15u))] = _e981.y;
let _e1001 = (_e703 + (2u * _e986));
shared_keys[(_e1001 ^ ((_e1001 >> bitcast<u32>(4i)) & 15u))] = _e981.z;
let _e1009 = (_e703 + (3u * _e986));
shared_keys[(_e1009 ^ ((_e1009 >> bitcast<u32>(4i)) & 15u))] = _e981.w;
let _e1017 = (_e703 + (4u * _e986));
shared_keys[(_e1017 ^ ((_e1017 >> bitcast<u32>(4i)) & 15u))] = _e982.x;
let _e1024 = (_e1017 + _e986);
shared_keys[(_e1024 ^ ((_e1024 >> bitcast<u32>(4i)) & 15u))] = _e982.y;
let _e1032 = (_e1017 + (2u * _e986));
shared_keys[(_e1032 ^ ((_e1032 >> bitcast<u32>(4i)) & 15u))] = _e982.z;
let _e1040 = (_e1017 + (3u * _e986));
shared_keys[(_e1040 ^ ((_e1040 >> bitcast<u32>(4i)) & 15u))] = _e982.w;
let _e1048 = (_e703 + (8u * _e986));
shared_keys[(_e1048 ^ ((_e1048 >> bitcast<u32>(4i)) & 15u))] = _e983.x;
let _e1055 = (_e1048 + _e986);
shared_keys[(_e1055 ^ ((_e1055 >> bitcast<u32>(4i)) & 15u))] = _e983.y;
let _e1063 = (_e1048 + (2u * _e986));
shared_keys[(_e1063 ^ ((_e1063 >> bitcast<u32>(4i)) & 15u))] = _e983.z;
let _e1071 = (_e1048 + (3u * _e986));
shared_keys[(_e1071 ^ ((_e1071 >> bitcast<u32>(4i)) & 15u))] = _e983.w;
let _e1079 = (_e703 + (12u * _e986));
shared_keys[(_e1079 ^ ((_e1079 >> bitcast<u32>(4i)) & 15u))] = _e984.x;
let _e1086 = (_e1079 + _e986);
shared_keys[(_e1086 ^ ((_e1086 >> bitcast<u32>(4i)) & 15u))] = _e984.y;
let _e1094 = (_e1079 + (2u * _e986));
shared_keys[(_e1094 ^ ((_e1094 >> bitcast<u32>(4i)) & 15u))] = _e984.z;
let _e1102 = (_e1079 + (3u * _e986));
shared_keys[(_e1102 ^ ((_e1102 >> bitcast<u32>(4i)) & 15u))] = _e984.w;
workgroupBarrier();
local = (_e689 - _e693);
continue;
} else {
break;
}
continuing {
let _e1133 = local;
phi_4729_ = _e1133;
}
}
continue;
} else {
break;
}
continuing {
phi_4727_ = (_e683 + bitcast<u32>(1i));
}
}
phi_4728_ = 0u;
loop {
let _e1114 = phi_4728_;
if (_e1114 < 4096u) {
continue;
} else {
break;
}
continuing {
let _e1118 = (_e1114 + _e41.x);
let _e1124 = shared_keys[(_e1118 ^ ((_e1118 >> bitcast<u32>(4i)) & 15u))];
GsacKeys_1.data[((_e43 + _e1114) + _e41.x)] = _e1124;
phi_4728_ = (_e1114 + 256u);
}
}
return;
}

@compute @workgroup_size(256, 1, 1)
fn SortBlocks(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) id: vec3<u32>) {
group_1 = group;
id_1 = id;
SortBlocks_1();
}
` },
  SortAcross: { bindings: {"GsacKeys": 1, "parameters": 0}, parameters: {"GsacVertexCount": 0, "GsacSplatCount": 4, "GsacIndexBits": 8, "GsacSortStage": 12, "GsacSortShift": 16, "GsacSortStrides": 20, "GsacDepthRange": 24, "GsacDepthRow": 32, "GsacLightRed": 48, "GsacLightGreen": 64, "GsacLightBlue": 80, "GsacSceneRed": 96, "GsacSceneGreen": 112, "GsacSceneBlue": 128, "GsacSceneRed2": 144, "GsacSceneGreen2": 160, "GsacSceneBlue2": 176, "GsacSceneLast": 192}, code: `
struct GsacKeys {
data: array<u32>,
}

struct GsacParams {
GsacVertexCount: u32,
GsacSplatCount: u32,
GsacIndexBits: u32,
GsacSortStage: u32,
GsacSortShift: u32,
GsacSortStrides: u32,
GsacDepthRange: vec2<f32>,
GsacDepthRow: vec4<f32>,
GsacLightRed: vec4<f32>,
GsacLightGreen: vec4<f32>,
GsacLightBlue: vec4<f32>,
GsacSceneRed: vec4<f32>,
GsacSceneGreen: vec4<f32>,
GsacSceneBlue: vec4<f32>,
GsacSceneRed2_: vec4<f32>,
GsacSceneGreen2_: vec4<f32>,
GsacSceneBlue2_: vec4<f32>,
GsacSceneLast: vec4<f32>,
}

@group(0) @binding(1)
var<storage, read_write> GsacKeys_1: GsacKeys;
@group(0) @binding(0)
var<uniform> unnamed: GsacParams;
var<private> id_1: vec3<u32>;

fn SortAcross_1() {
var phi_1321_: vec4<u32>;
var phi_1320_: vec4<u32>;
var phi_1319_: vec4<u32>;
var phi_1318_: vec4<u32>;
var phi_1325_: vec4<u32>;
var phi_1324_: vec4<u32>;
var phi_1323_: vec4<u32>;
var phi_1322_: vec4<u32>;
var phi_1329_: vec4<u32>;
var phi_1328_: vec4<u32>;
var phi_1327_: vec4<u32>;
var phi_1326_: vec4<u32>;
var phi_1333_: vec4<u32>;
var phi_1332_: vec4<u32>;
var phi_1331_: vec4<u32>;
var phi_1330_: vec4<u32>;

let _e17 = id_1;
let _e19 = unnamed.GsacSortShift;
let _e21 = (1u << bitcast<u32>(_e19));
let _e24 = unnamed.GsacSortShift;
let _e34 = (((_e17.x >> bitcast<u32>(_e24)) << bitcast<u32>((_e24 + 4u))) | (_e17.x & ((1u << bitcast<u32>(_e24)) - 1u)));
let _e37 = GsacKeys_1.data[_e34];
let _e41 = GsacKeys_1.data[(_e34 + _e21)];
let _e46 = GsacKeys_1.data[(_e34 + (2u * _e21))];
let _e51 = GsacKeys_1.data[(_e34 + (3u * _e21))];
let _e54 = (_e34 + (4u * _e21));
let _e57 = GsacKeys_1.data[_e54];
let _e61 = GsacKeys_1.data[(_e54 + _e21)];
let _e66 = GsacKeys_1.data[(_e54 + (2u * _e21))];
let _e71 = GsacKeys_1.data[(_e54 + (3u * _e21))];
let _e74 = (_e34 + (8u * _e21));
let _e77 = GsacKeys_1.data[_e74];
let _e81 = GsacKeys_1.data[(_e74 + _e21)];
let _e86 = GsacKeys_1.data[(_e74 + (2u * _e21))];
let _e91 = GsacKeys_1.data[(_e74 + (3u * _e21))];
let _e94 = (_e34 + (12u * _e21));
let _e97 = GsacKeys_1.data[_e94];
let _e101 = GsacKeys_1.data[(_e94 + _e21)];
let _e106 = GsacKeys_1.data[(_e94 + (2u * _e21))];
let _e111 = GsacKeys_1.data[(_e94 + (3u * _e21))];
let _e114 = unnamed.GsacSortStrides;
let _e116 = unnamed.GsacSortStage;
let _e120 = select(vec4<u32>(4294967295u, 4294967295u, 4294967295u, 4294967295u), vec4<u32>(0u, 0u, 0u, 0u), vec4(((_e34 & _e116) == 0u)));
let _e121 = (vec4<u32>(_e37, _e41, _e46, _e51) ^ _e120);
let _e122 = (vec4<u32>(_e57, _e61, _e66, _e71) ^ _e120);
let _e123 = (vec4<u32>(_e77, _e81, _e86, _e91) ^ _e120);
let _e124 = (vec4<u32>(_e97, _e101, _e106, _e111) ^ _e120);
phi_1321_ = _e124;
phi_1320_ = _e123;
phi_1319_ = _e122;
phi_1318_ = _e121;
if ((_e114 & 8u) != 0u) {
phi_1321_ = max(_e122, _e124);
phi_1320_ = max(_e121, _e123);
phi_1319_ = min(_e122, _e124);
phi_1318_ = min(_e121, _e123);
}
let _e132 = phi_1321_;
let _e134 = phi_1320_;
let _e136 = phi_1319_;
let _e138 = phi_1318_;
phi_1325_ = _e132;
phi_1324_ = _e134;
phi_1323_ = _e136;
phi_1322_ = _e138;
if ((_e114 & 4u) != 0u) {
phi_1325_ = max(_e134, _e132);
phi_1324_ = min(_e134, _e132);
phi_1323_ = max(_e138, _e136);
phi_1322_ = min(_e138, _e136);
}
let _e146 = phi_1325_;
let _e148 = phi_1324_;
let _e150 = phi_1323_;
let _e152 = phi_1322_;
phi_1329_ = _e146;
phi_1328_ = _e148;
phi_1327_ = _e150;
phi_1326_ = _e152;
if ((_e114 & 2u) != 0u) {
let _e157 = min(_e152.xy, _e152.zw);
let _e160 = max(_e152.xy, _e152.zw);
let _e168 = min(_e150.xy, _e150.zw);
let _e171 = max(_e150.xy, _e150.zw);
let _e179 = min(_e148.xy, _e148.zw);
let _e182 = max(_e148.xy, _e148.zw);
let _e190 = min(_e146.xy, _e146.zw);
let _e193 = max(_e146.xy, _e146.zw);
phi_1329_ = vec4<u32>(_e190.x, _e190.y, _e193.x, _e193.y);
phi_1328_ = vec4<u32>(_e179.x, _e179.y, _e182.x, _e182.y);
phi_1327_ = vec4<u32>(_e168.x, _e168.y, _e171.x, _e171.y);
phi_1326_ = vec4<u32>(_e157.x, _e157.y, _e160.x, _e160.y);
}
let _e200 = phi_1329_;
let _e202 = phi_1328_;
let _e204 = phi_1327_;
let _e206 = phi_1326_;
phi_1333_ = _e206;
phi_1332_ = _e204;
phi_1331_ = _e202;
phi_1330_ = _e200;
if ((_e114 & 1u) != 0u) {
let _e211 = min(_e206.xz, _e206.yw);
let _e214 = max(_e206.xz, _e206.yw);
let _e222 = min(_e204.xz, _e204.yw);
let _e225 = max(_e204.xz, _e204.yw);
let _e233 = min(_e202.xz, _e202.yw);
let _e236 = max(_e202.xz, _e202.yw);
let _e244 = min(_e200.xz, _e200.yw);
let _e247 = max(_e200.xz, _e200.yw);
phi_1333_ = vec4<u32>(_e211.x, _e214.x, _e211.y, _e214.y);
phi_1332_ = vec4<u32>(_e222.x, _e225.x, _e222.y, _e225.y);
phi_1331_ = vec4<u32>(_e233.x, _e236.x, _e233.y, _e236.y);
phi_1330_ = vec4<u32>(_e244.x, _e247.x, _e244.y, _e247.y);
}
let _e254 = phi_1333_;
let _e256 = phi_1332_;
let _e258 = phi_1331_;
let _e260 = phi_1330_;
let _e261 = (_e254 ^ _e120);
let _e262 = (_e256 ^ _e120);
let _e263 = (_e258 ^ _e120);
let _e264 = (_e260 ^ _e120);
GsacKeys_1.data[_e34] = _e261.x;
GsacKeys_1.data[(_e34 + _e21)] = _e261.y;
GsacKeys_1.data[(_e34 + (2u * _e21))] = _e261.z;
GsacKeys_1.data[(_e34 + (3u * _e21))] = _e261.w;
let _e283 = (_e34 + (4u * _e21));
GsacKeys_1.data[_e283] = _e262.x;
GsacKeys_1.data[(_e283 + _e21)] = _e262.y;
GsacKeys_1.data[(_e283 + (2u * _e21))] = _e262.z;
GsacKeys_1.data[(_e283 + (3u * _e21))] = _e262.w;
let _e302 = (_e34 + (8u * _e21));
GsacKeys_1.data[_e302] = _e263.x;
GsacKeys_1.data[(_e302 + _e21)] = _e263.y;
GsacKeys_1.data[(_e302 + (2u * _e21))] = _e263.z;
GsacKeys_1.data[(_e302 + (3u * _e21))] = _e263.w;
let _e321 = (_e34 + (12u * _e21));
GsacKeys_1.data[_e321] = _e264.x;
GsacKeys_1.data[(_e321 + _e21)] = _e264.y;
GsacKeys_1.data[(_e321 + (2u * _e21))] = _e264.z;
GsacKeys_1.data[(_e321 + (3u * _e21))] = _e264.w;
return;
}

@compute @workgroup_size(64, 1, 1)
fn SortAcross(@builtin(global_invocation_id) id: vec3<u32>) {
id_1 = id;
SortAcross_1();
}
` },
  SortMerge: { bindings: {"GsacKeys": 1, "parameters": 0}, parameters: {"GsacVertexCount": 0, "GsacSplatCount": 4, "GsacIndexBits": 8, "GsacSortStage": 12, "GsacSortShift": 16, "GsacSortStrides": 20, "GsacDepthRange": 24, "GsacDepthRow": 32, "GsacLightRed": 48, "GsacLightGreen": 64, "GsacLightBlue": 80, "GsacSceneRed": 96, "GsacSceneGreen": 112, "GsacSceneBlue": 128, "GsacSceneRed2": 144, "GsacSceneGreen2": 160, "GsacSceneBlue2": 176, "GsacSceneLast": 192}, code: `
struct GsacKeys {
data: array<u32>,
}

struct GsacParams {
GsacVertexCount: u32,
GsacSplatCount: u32,
GsacIndexBits: u32,
GsacSortStage: u32,
GsacSortShift: u32,
GsacSortStrides: u32,
GsacDepthRange: vec2<f32>,
GsacDepthRow: vec4<f32>,
GsacLightRed: vec4<f32>,
GsacLightGreen: vec4<f32>,
GsacLightBlue: vec4<f32>,
GsacSceneRed: vec4<f32>,
GsacSceneGreen: vec4<f32>,
GsacSceneBlue: vec4<f32>,
GsacSceneRed2_: vec4<f32>,
GsacSceneGreen2_: vec4<f32>,
GsacSceneBlue2_: vec4<f32>,
GsacSceneLast: vec4<f32>,
}

var<workgroup> shared_keys: array<u32, 4096>;
@group(0) @binding(1)
var<storage, read_write> GsacKeys_1: GsacKeys;
@group(0) @binding(0)
var<uniform> unnamed: GsacParams;
var<private> group_1: vec3<u32>;
var<private> id_1: vec3<u32>;

fn SortMerge_1() {
var phi_1928_: u32;
var phi_1929_: u32;
var phi_1934_: vec4<u32>;
var phi_1933_: vec4<u32>;
var phi_1932_: vec4<u32>;
var phi_1931_: vec4<u32>;
var phi_1938_: vec4<u32>;
var phi_1937_: vec4<u32>;
var phi_1936_: vec4<u32>;
var phi_1935_: vec4<u32>;
var phi_1942_: vec4<u32>;
var phi_1941_: vec4<u32>;
var phi_1940_: vec4<u32>;
var phi_1939_: vec4<u32>;
var phi_1946_: vec4<u32>;
var phi_1945_: vec4<u32>;
var phi_1944_: vec4<u32>;
var phi_1943_: vec4<u32>;
var phi_1930_: u32;
var local: u32;

let _e23 = group_1;
let _e24 = id_1;
let _e26 = (_e23.x * 4096u);
phi_1928_ = 0u;
loop {
let _e28 = phi_1928_;
if (_e28 < 4096u) {
continue;
} else {
break;
}
continuing {
let _e31 = (_e28 + _e24.x);
let _e41 = GsacKeys_1.data[((_e26 + _e28) + _e24.x)];
shared_keys[(_e31 ^ ((_e31 >> bitcast<u32>(4i)) & 15u))] = _e41;
phi_1928_ = (_e28 + 256u);
}
}
workgroupBarrier();
let _e46 = unnamed.GsacSortStage;
phi_1929_ = 12u;
loop {
let _e48 = phi_1929_;
if (_e48 > 0u) {
let _e52 = (((_e48 - 1u) & 3u) + 1u);
let _e53 = (_e48 - 4u);
let _e62 = (((_e24.x >> bitcast<u32>(_e53)) << bitcast<u32>(_e48)) | (_e24.x & ((1u << bitcast<u32>(_e53)) - 1u)));
let _e64 = (1u << bitcast<u32>(_e53));
let _e70 = shared_keys[(_e62 ^ ((_e62 >> bitcast<u32>(4i)) & 15u))];
let _e71 = (_e62 + _e64);
let _e77 = shared_keys[(_e71 ^ ((_e71 >> bitcast<u32>(4i)) & 15u))];
let _e79 = (_e62 + (2u * _e64));
let _e85 = shared_keys[(_e79 ^ ((_e79 >> bitcast<u32>(4i)) & 15u))];
let _e87 = (_e62 + (3u * _e64));
let _e93 = shared_keys[(_e87 ^ ((_e87 >> bitcast<u32>(4i)) & 15u))];
let _e96 = (_e62 + (4u * _e64));
let _e102 = shared_keys[(_e96 ^ ((_e96 >> bitcast<u32>(4i)) & 15u))];
let _e103 = (_e96 + _e64);
let _e109 = shared_keys[(_e103 ^ ((_e103 >> bitcast<u32>(4i)) & 15u))];
let _e111 = (_e96 + (2u * _e64));
let _e117 = shared_keys[(_e111 ^ ((_e111 >> bitcast<u32>(4i)) & 15u))];
let _e119 = (_e96 + (3u * _e64));
let _e125 = shared_keys[(_e119 ^ ((_e119 >> bitcast<u32>(4i)) & 15u))];
let _e128 = (_e62 + (8u * _e64));
let _e134 = shared_keys[(_e128 ^ ((_e128 >> bitcast<u32>(4i)) & 15u))];
let _e135 = (_e128 + _e64);
let _e141 = shared_keys[(_e135 ^ ((_e135 >> bitcast<u32>(4i)) & 15u))];
let _e143 = (_e128 + (2u * _e64));
let _e149 = shared_keys[(_e143 ^ ((_e143 >> bitcast<u32>(4i)) & 15u))];
let _e151 = (_e128 + (3u * _e64));
let _e157 = shared_keys[(_e151 ^ ((_e151 >> bitcast<u32>(4i)) & 15u))];
let _e160 = (_e62 + (12u * _e64));
let _e166 = shared_keys[(_e160 ^ ((_e160 >> bitcast<u32>(4i)) & 15u))];
let _e167 = (_e160 + _e64);
let _e173 = shared_keys[(_e167 ^ ((_e167 >> bitcast<u32>(4i)) & 15u))];
let _e175 = (_e160 + (2u * _e64));
let _e181 = shared_keys[(_e175 ^ ((_e175 >> bitcast<u32>(4i)) & 15u))];
let _e183 = (_e160 + (3u * _e64));
let _e189 = shared_keys[(_e183 ^ ((_e183 >> bitcast<u32>(4i)) & 15u))];
let _e194 = bitcast<u32>((15i ^ (15i >> bitcast<u32>(_e52))));
let _e199 = select(vec4<u32>(4294967295u, 4294967295u, 4294967295u, 4294967295u), vec4<u32>(0u, 0u, 0u, 0u), vec4((((_e26 + _e62) & _e46) == 0u)));
let _e200 = (vec4<u32>(_e70, _e77, _e85, _e93) ^ _e199);
let _e201 = (vec4<u32>(_e102, _e109, _e117, _e125) ^ _e199);
let _e202 = (vec4<u32>(_e134, _e141, _e149, _e157) ^ _e199);
let _e203 = (vec4<u32>(_e166, _e173, _e181, _e189) ^ _e199);
phi_1934_ = _e203;
phi_1933_ = _e202;
phi_1932_ = _e201;
phi_1931_ = _e200;
if ((_e194 & 8u) != 0u) {
phi_1934_ = max(_e201, _e203);
phi_1933_ = max(_e200, _e202);
phi_1932_ = min(_e201, _e203);
phi_1931_ = min(_e200, _e202);
}
let _e211 = phi_1934_;
let _e213 = phi_1933_;
let _e215 = phi_1932_;
let _e217 = phi_1931_;
phi_1938_ = _e211;
phi_1937_ = _e213;
phi_1936_ = _e215;
phi_1935_ = _e217;
if ((_e194 & 4u) != 0u) {
phi_1938_ = max(_e213, _e211);
phi_1937_ = min(_e213, _e211);
phi_1936_ = max(_e217, _e215);
phi_1935_ = min(_e217, _e215);
}
let _e225 = phi_1938_;
let _e227 = phi_1937_;
let _e229 = phi_1936_;
let _e231 = phi_1935_;
phi_1942_ = _e225;
phi_1941_ = _e227;
phi_1940_ = _e229;
phi_1939_ = _e231;
if ((_e194 & 2u) != 0u) {
let _e236 = min(_e231.xy, _e231.zw);
let _e239 = max(_e231.xy, _e231.zw);
let _e247 = min(_e229.xy, _e229.zw);
let _e250 = max(_e229.xy, _e229.zw);
let _e258 = min(_e227.xy, _e227.zw);
let _e261 = max(_e227.xy, _e227.zw);
let _e269 = min(_e225.xy, _e225.zw);
let _e272 = max(_e225.xy, _e225.zw);
phi_1942_ = vec4<u32>(_e269.x, _e269.y, _e272.x, _e272.y);
phi_1941_ = vec4<u32>(_e258.x, _e258.y, _e261.x, _e261.y);
phi_1940_ = vec4<u32>(_e247.x, _e247.y, _e250.x, _e250.y);
phi_1939_ = vec4<u32>(_e236.x, _e236.y, _e239.x, _e239.y);
}
let _e279 = phi_1942_;
let _e281 = phi_1941_;
let _e283 = phi_1940_;
let _e285 = phi_1939_;
phi_1946_ = _e285;
phi_1945_ = _e283;
phi_1944_ = _e281;
phi_1943_ = _e279;
if ((_e194 & 1u) != 0u) {
let _e290 = min(_e285.xz, _e285.yw);
let _e293 = max(_e285.xz, _e285.yw);
let _e301 = min(_e283.xz, _e283.yw);
let _e304 = max(_e283.xz, _e283.yw);
let _e312 = min(_e281.xz, _e281.yw);
let _e315 = max(_e281.xz, _e281.yw);
let _e323 = min(_e279.xz, _e279.yw);
let _e326 = max(_e279.xz, _e279.yw);
phi_1946_ = vec4<u32>(_e290.x, _e293.x, _e290.y, _e293.y);
phi_1945_ = vec4<u32>(_e301.x, _e304.x, _e301.y, _e304.y);
phi_1944_ = vec4<u32>(_e312.x, _e315.x, _e312.y, _e315.y);
phi_1943_ = vec4<u32>(_e323.x, _e326.x, _e323.y, _e326.y);
}
let _e333 = phi_1946_;
let _e335 = phi_1945_;
let _e337 = phi_1944_;
let _e339 = phi_1943_;
let _e340 = (_e333 ^ _e199);
let _e341 = (_e335 ^ _e199);
let _e342 = (_e337 ^ _e199);
let _e343 = (_e339 ^ _e199);
let _e345 = (1u << bitcast<u32>(_e53));
shared_keys[(_e62 ^ ((_e62 >> bitcast<u32>(4i)) & 15u))] = _e340.x;
let _e352 = (_e62 + _e345);
shared_keys[(_e352 ^ ((_e352 >> bitcast<u32>(4i)) & 15u))] = _e340.y;
let _e360 = (_e62 + (2u * _e345));
shared_keys[(_e360 ^ ((_e360 >> bitcast<u32>(4i)) & 15u))] = _e340.z;
let _e368 = (_e62 + (3u * _e345));
shared_keys[(_e368 ^ ((_e368 >> bitcast<u32>(4i)) & 15u))] = _e340.w;
let _e376 = (_e62 + (4u * _e345));
shared_keys[(_e376 ^ ((_e376 >> bitcast<u32>(4i)) & 15u))] = _e341.x;
let _e383 = (_e376 + _e345);
shared_keys[(_e383 ^ ((_e383 >> bitcast<u32>(4i)) & 15u))] = _e341.y;
let _e391 = (_e376 + (2u * _e345));
shared_keys[(_e391 ^ ((_e391 >> bitcast<u32>(4i)) & 15u))] = _e341.z;
let _e399 = (_e376 + (3u * _e345));
shared_keys[(_e399 ^ ((_e399 >> bitcast<u32>(4i)) & 15u))] = _e341.w;
let _e407 = (_e62 + (8u * _e345));
shared_keys[(_e407 ^ ((_e407 >> bitcast<u32>(4i)) & 15u))] = _e342.x;
let _e414 = (_e407 + _e345);
shared_keys[(_e414 ^ ((_e414 >> bitcast<u32>(4i)) & 15u))] = _e342.y;
let _e422 = (_e407 + (2u * _e345));
shared_keys[(_e422 ^ ((_e422 >> bitcast<u32>(4i)) & 15u))] = _e342.z;
let _e430 = (_e407 + (3u * _e345));
shared_keys[(_e430 ^ ((_e430 >> bitcast<u32>(4i)) & 15u))] = _e342.w;
let _e438 = (_e62 + (12u * _e345));
shared_keys[(_e438 ^ ((_e438 >> bitcast<u32>(4i)) & 15u))] = _e343.x;
let _e445 = (_e438 + _e345);
shared_keys[(_e445 ^ ((_e445 >> bitcast<u32>(4i)) & 15u))] = _e343.y;
let _e453 = (_e438 + (2u * _e345));
shared_keys[(_e453 ^ ((_e453 >> bitcast<u32>(4i)) & 15u))] = _e343.z;
let _e461 = (_e438 + (3u * _e345));
shared_keys[(_e461 ^ ((_e461 >> bitcast<u32>(4i)) & 15u))] = _e343.w;
workgroupBarrier();
local = (_e48 - _e52);
continue;
} else {
break;
}
continuing {
let _e488 = local;
phi_1929_ = _e488;
}
}
phi_1930_ = 0u;
loop {
let _e471 = phi_1930_;
if (_e471 < 4096u) {
continue;
} else {
break;
}
continuing {
let _e475 = (_e471 + _e24.x);
let _e481 = shared_keys[(_e475 ^ ((_e475 >> bitcast<u32>(4i)) & 15u))];
GsacKeys_1.data[((_e26 + _e471) + _e24.x)] = _e481;
phi_1930_ = (_e471 + 256u);
}
}
return;
}

@compute @workgroup_size(256, 1, 1)
fn SortMerge(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) id: vec3<u32>) {
group_1 = group;
id_1 = id;
SortMerge_1();
}
` },
  Correct: { bindings: {"parameters": 0, "GsacRest": 1, "GsacFirst": 3, "GsacPairs": 2, "GsacTurns": 4, "GsacBent": 5}, parameters: {"GsacVertexCount": 0, "GsacSplatCount": 4, "GsacIndexBits": 8, "GsacSortStage": 12, "GsacSortShift": 16, "GsacSortStrides": 20, "GsacDepthRange": 24, "GsacDepthRow": 32, "GsacLightRed": 48, "GsacLightGreen": 64, "GsacLightBlue": 80, "GsacSceneRed": 96, "GsacSceneGreen": 112, "GsacSceneBlue": 128, "GsacSceneRed2": 144, "GsacSceneGreen2": 160, "GsacSceneBlue2": 176, "GsacSceneLast": 192}, code: `
struct GsacParams {
GsacVertexCount: u32,
GsacSplatCount: u32,
GsacIndexBits: u32,
GsacSortStage: u32,
GsacSortShift: u32,
GsacSortStrides: u32,
GsacDepthRange: vec2<f32>,
GsacDepthRow: vec4<f32>,
GsacLightRed: vec4<f32>,
GsacLightGreen: vec4<f32>,
GsacLightBlue: vec4<f32>,
GsacSceneRed: vec4<f32>,
GsacSceneGreen: vec4<f32>,
GsacSceneBlue: vec4<f32>,
GsacSceneRed2_: vec4<f32>,
GsacSceneGreen2_: vec4<f32>,
GsacSceneBlue2_: vec4<f32>,
GsacSceneLast: vec4<f32>,
}

struct GsacRest {
data: array<vec4<f32>>,
}

struct GsacFirst {
data: array<u32>,
}

struct GsacBent {
data: array<vec4<f32>>,
}

@group(0) @binding(0)
var<uniform> unnamed: GsacParams;
@group(0) @binding(1)
var<storage> GsacRest_1: GsacRest;
@group(0) @binding(3)
var<storage> GsacFirst_1: GsacFirst;
@group(0) @binding(2)
var<storage> GsacPairs: GsacRest;
@group(0) @binding(4)
var<storage> GsacTurns: GsacRest;
@group(0) @binding(5)
var<storage, read_write> GsacBent_1: GsacBent;
var<private> id_1: vec3<u32>;

fn Correct_1() {
var phi_461_: vec3<f32>;
var phi_460_: u32;
var local: vec3<f32>;
var local_1: vec3<f32>;
var local_2: vec3<f32>;

let _e18 = id_1;
switch bitcast<i32>(0u) {
default: {
let _e22 = unnamed.GsacVertexCount;
if (_e18.x >= _e22) {
break;
}
let _e26 = GsacRest_1.data[_e18.x];
let _e31 = GsacFirst_1.data[(_e18.x + 1u)];
let _e34 = GsacFirst_1.data[_e18.x];
phi_461_ = _e26.xyz;
phi_460_ = _e34;
loop {
let _e36 = phi_461_;
let _e38 = phi_460_;
local = _e36;
local_1 = _e36;
local_2 = _e36;
if (_e38 < _e31) {
continue;
} else {
break;
}
continuing {
let _e40 = (_e38 * 7u);
let _e43 = GsacPairs.data[_e40];
let _e47 = GsacPairs.data[(_e40 + 1u)];
let _e51 = GsacPairs.data[(_e40 + 2u)];
let _e55 = GsacPairs.data[(_e40 + 3u)];
let _e59 = GsacPairs.data[(_e40 + 4u)];
let _e63 = GsacPairs.data[(_e40 + 5u)];
let _e67 = GsacPairs.data[(_e40 + 6u)];
let _e70 = (u32(_e67.w) * 3u);
let _e73 = GsacTurns.data[_e70];
let _e77 = GsacTurns.data[(_e70 + 1u)];
let _e82 = GsacTurns.data[(_e70 + 2u)][0u];
phi_461_ = vec3<f32>((_e36.x + fma(_e51.x, _e82, (dot(_e43, _e73) + dot(_e47, _e77)))), (_e36.y + fma(_e59.y, _e82, (dot(vec4<f32>(_e51.y, _e51.z, _e51.w, _e55.x), _e73) + dot(vec4<f32>(_e55.y, _e55.z, _e55.w, _e59.x), _e77)))), (_e36.z + fma(_e67.z, _e82, (dot(vec4<f32>(_e59.z, _e59.w, _e63.x, _e63.y), _e73) + dot(vec4<f32>(_e63.z, _e63.w, _e67.x, _e67.y), _e77)))));
phi_460_ = (_e38 + bitcast<u32>(1i));
}
}
let _e128 = local;
let _e131 = local_1;
let _e134 = local_2;
GsacBent_1.data[_e18.x] = vec4<f32>(_e128.x, _e131.y, _e134.z, 1f);
break;
}
}
return;
}

@compute @workgroup_size(64, 1, 1)
fn Correct(@builtin(global_invocation_id) id: vec3<u32>) {
id_1 = id;
Correct_1();
}
` },
  SplatVertex: { bindings: {"GsacKeys": 3, "parameters": 0, "GsacColours": 2, "GsacSplats": 1}, parameters: {"GsacModel0": 0, "GsacModel1": 16, "GsacModel2": 32, "GsacBlend": 48, "GsacKeepsEnergy": 64, "GsacIndexBits": 68, "PageView0": 80, "PageView1": 96, "PageView2": 112, "PageLens": 128, "PageDisc": 144, "PageInk": 160}, code: `
struct GsacKeys {
data: array<u32>,
}

struct u0024_Global {
GsacModel0_: vec4<f32>,
GsacModel1_: vec4<f32>,
GsacModel2_: vec4<f32>,
GsacBlend: vec4<f32>,
GsacKeepsEnergy: u32,
GsacIndexBits: u32,
PageView0_: vec4<f32>,
PageView1_: vec4<f32>,
PageView2_: vec4<f32>,
PageLens: vec4<f32>,
PageDisc: vec4<f32>,
PageInk: vec4<f32>,
}

struct GsacColours {
data: array<vec4<f32>>,
}

struct VertexOutput {
@builtin(position) member: vec4<f32>,
@location(0) member_1: vec2<f32>,
@location(1) @interpolate(flat) member_2: vec4<f32>,
}

@group(0) @binding(3)
var<storage> GsacKeys_1: GsacKeys;
@group(0) @binding(0)
var<uniform> unnamed: u0024_Global;
@group(0) @binding(2)
var<storage> GsacColours_1: GsacColours;
@group(0) @binding(1)
var<storage> GsacSplats: GsacColours;
var<private> vertex_1: u32;
var<private> entryPointOutput_u002e_clip: vec4<f32> = vec4<f32>(0f, 0f, 0f, 1f);
var<private> entryPointOutput_u002e_sigmas: vec2<f32>;
var<private> entryPointOutput_u002e_colour: vec4<f32>;

fn SplatVertex_1() {
var phi_2051_: vec2<f32>;
var phi_2053_: vec4<f32>;
var phi_2056_: vec4<f32>;
var phi_2061_: vec4<f32>;
var phi_2060_: vec2<f32>;
var phi_2059_: vec4<f32>;

let _e54 = vertex_1;
let _e56 = unnamed.PageView0_;
let _e58 = unnamed.PageView1_;
let _e60 = unnamed.PageView2_;
let _e61 = mat4x4<f32>(_e56, _e58, _e60, vec4<f32>(0f, 0f, 0f, 1f));
let _e64 = unnamed.PageLens[0u];
let _e67 = unnamed.PageLens[2u];
let _e70 = unnamed.PageLens[1u];
let _e71 = -(_e70);
let _e74 = unnamed.PageLens[3u];
let _e75 = -(_e74);
let _e80 = unnamed.PageInk;
let _e81 = _e80.xy;
switch bitcast<i32>(0u) {
default: {
let _e87 = GsacKeys_1.data[(_e54 >> bitcast<u32>(2i))];
let _e89 = unnamed.GsacIndexBits;
let _e93 = (_e87 & ((1u << bitcast<u32>(_e89)) - 1u));
let _e96 = GsacColours_1.data[_e93];
let _e100 = GsacSplats.data[(_e93 * 3u)];
let _e105 = GsacSplats.data[((_e93 * 3u) + 1u)];
let _e110 = GsacSplats.data[((_e93 * 3u) + 2u)];
let _e113 = (_e96.xyz * _e110.yzw);
let _e119 = vec4<f32>(_e113.x, _e96.y, _e96.z, _e96.w);
let _e125 = vec4<f32>(_e119.x, _e113.y, _e119.z, _e119.w);
let _e131 = vec4<f32>(_e125.x, _e125.y, _e113.z, _e125.w);
let _e134 = unnamed.GsacModel0_[0u];
let _e137 = unnamed.GsacModel1_[0u];
let _e140 = unnamed.GsacModel2_[0u];
let _e144 = unnamed.GsacModel0_[1u];
let _e147 = unnamed.GsacModel1_[1u];
let _e150 = unnamed.GsacModel2_[1u];
let _e154 = unnamed.GsacModel0_[2u];
let _e157 = unnamed.GsacModel1_[2u];
let _e160 = unnamed.GsacModel2_[2u];
let _e172 = unnamed.GsacModel0_[3u];
let _e175 = unnamed.GsacModel1_[3u];
let _e178 = unnamed.GsacModel2_[3u];
let _e180 = ((((vec3<f32>(_e134, _e137, _e140) * _e100.x) + (vec3<f32>(_e144, _e147, _e150) * _e100.y)) + (vec3<f32>(_e154, _e157, _e160) * _e100.z)) + vec3<f32>(_e172, _e175, _e178));
let _e185 = (vec4<f32>(_e180.x, _e180.y, _e180.z, 1f) * _e61);
let _e187 = -(_e185.z);
let _e188 = vec2<f32>(_e64, 0f);
let _e189 = vec2<f32>(0f, _e71);
let _e190 = vec2<f32>(_e67, _e75);
let _e191 = length(_e188);
let _e192 = length(_e189);
let _e193 = vec2<f32>(_e191, _e192);
let _e195 = (_e188 / vec2(_e191));
let _e197 = (_e189 / vec2(_e192));
let _e201 = (vec2<f32>(dot(_e195, _e190), dot(_e197, _e190)) / _e193);
let _e208 = unnamed.GsacBlend[2u];
if (!((false || (_e187 > 0.01f))) || (_e96.w < _e208)) {
phi_2061_ = vec4<f32>(2f, 2f, 2f, 1f);
phi_2060_ = vec2<f32>(0f, 0f);
phi_2059_ = _e131;
break;
}
let _e212 = (vec4<f32>(_e134, _e137, _e140, 0f) * _e61);
let _e214 = (vec4<f32>(_e144, _e147, _e150, 0f) * _e61);
let _e216 = (vec4<f32>(_e154, _e157, _e160, 0f) * _e61);
let _e217 = (_e81 * _e193);
let _e219 = (_e80.yx * _e193);
let _e237 = select(_e81, _e80.yx, vec2(((abs(_e195.x) < abs(_e195.y)) && (abs((_e219.x - _e219.y)) < abs((_e217.x - _e217.y))))));
let _e253 = -(vec3<f32>(_e212.z, _e214.z, _e216.z));
let _e261 = ((_e237 * 0.5f) * _e193);
let _e262 = (vec2<f32>(1f, 1f) / _e193);
let _e265 = unnamed.GsacBlend[0u];
let _e273 = clamp((vec3<f32>(_e185.x, _e185.y, _e187).xy / vec2(_e187)), (_e201 - (_e262 * 1.3f)), (_e201 + (_e262 * 1.3f)));
let _e279 = ((vec3<f32>(_e212.x, _e214.x, _e216.x) - (_e253 * _e273.x)) * (_e261.x / _e187));
let _e285 = ((vec3<f32>(_e212.y, _e214.y, _e216.y) - (_e253 * _e273.y)) * (_e261.y / _e187));
let _e304 = vec3<f32>(fma(_e105.w, _e279.z, fma(_e100.w, _e279.x, (_e105.z * _e279.y))), fma(_e110.x, _e279.z, fma(_e105.z, _e279.x, (_e105.x * _e279.y))), fma(_e105.y, _e279.z, fma(_e105.w, _e279.x, (_e110.x * _e279.y))));
let _e324 = dot(_e279, _e304);
let _e325 = dot(_e285, _e304);
let _e326 = dot(_e285, vec3<f32>(fma(_e105.w, _e285.z, fma(_e100.w, _e285.x, (_e105.z * _e285.y))), fma(_e110.x, _e285.z, fma(_e105.z, _e285.x, (_e105.x * _e285.y))), fma(_e105.y, _e285.z, fma(_e105.w, _e285.x, (_e110.x * _e285.y)))));
let _e330 = max(fma(_e324, _e326, -((_e325 * _e325))), 0f);
let _e333 = fma(_e265, ((_e324 + _e326) + _e265), _e330);
let _e334 = (_e324 + _e265);
let _e335 = (_e326 + _e265);
let _e336 = (_e334 + _e335);
let _e340 = length(vec2<f32>((0.5f * (_e334 - _e335)), _e325));
let _e341 = fma(0.5f, _e336, _e340);
phi_2051_ = vec2<f32>(1f, 0f);
if (_e340 > (_e336 * 0.0000005f)) {
phi_2051_ = normalize(select(vec2<f32>(_e325, (_e341 - _e334)), vec2<f32>((_e341 - _e335), _e325), vec2((_e334 > _e335))));
}
let _e355 = phi_2051_;
let _e368 = unnamed.GsacKeepsEnergy;
phi_2053_ = _e131;
if (_e368 != 0u) {
phi_2053_ = vec4<f32>(_e113.x, _e113.y, _e113.z, (_e96.w * sqrt((_e330 / max(_e333, 0.000000000001f)))));
}
let _e374 = phi_2053_;
let _e378 = unnamed.GsacBlend[2u];
let _e392 = (vec2<f32>(select(-1f, 1f, ((_e54 & 1u) != 0u)), select(-1f, 1f, ((_e54 & 2u) != 0u))) * (sqrt((2f * log(max((_e374.w / _e378), 1f)))) + 0.001f));
let _e399 = (((((_e355 * sqrt(_e341)) * _e392.x) + ((vec2<f32>(-(_e355.y), _e355.x) * sqrt(max((_e333 / _e341), 0.000001f))) * _e392.y)) * 2f) / _e237);
let _e404 = (vec4<f32>(_e185.x, _e185.y, _e185.z, 1f) * mat4x4<f32>(vec4<f32>(_e64, 0f, _e67, 0f), vec4<f32>(0f, _e71, _e75, 0f), vec4<f32>(0f, 0f, -1f, -0.02f), vec4<f32>(0f, 0f, -1f, 0f)));
let _e413 = (_e404.xy + (((_e195 * _e399.x) + (_e197 * _e399.y)) * _e404.w));
let _e419 = vec4<f32>(_e413.x, _e404.y, _e404.z, _e404.w);
let _e428 = unnamed.GsacBlend[3u];
phi_2056_ = _e374;
if (_e428 > 0.5f) {
let _e434 = pow(max(((_e374.xyz + vec3<f32>(0.055f, 0.055f, 0.055f)) * vec3<f32>(0.94786733f, 0.94786733f, 0.94786733f)), vec3<f32>(0f, 0f, 0f)), vec3<f32>(2.4f, 2.4f, 2.4f));
let _e457 = vec4<f32>(select((_e374.x * 0.07739938f), _e434.x, (_e374.x > 0.04045f)), _e374.y, _e374.z, _e374.w);
let _e462 = vec4<f32>(_e457.x, select((_e374.y * 0.07739938f), _e434.y, (_e374.y > 0.04045f)), _e457.z, _e457.w);
phi_2056_ = vec4<f32>(_e462.x, _e462.y, select((_e374.z * 0.07739938f), _e434.z, (_e374.z > 0.04045f)), _e462.w);
}
let _e469 = phi_2056_;
phi_2061_ = vec4<f32>(_e419.x, _e413.y, _e419.z, _e419.w);
phi_2060_ = _e392;
phi_2059_ = _e469;
break;
}
}
let _e471 = phi_2061_;
let _e473 = phi_2060_;
let _e475 = phi_2059_;
entryPointOutput_u002e_clip = _e471;
entryPointOutput_u002e_sigmas = _e473;
entryPointOutput_u002e_colour = _e475;
return;
}

@vertex
fn SplatVertex(@builtin(vertex_index) vertex: u32) -> VertexOutput {
vertex_1 = vertex;
SplatVertex_1();
let _e6 = entryPointOutput_u002e_clip.y;
entryPointOutput_u002e_clip.y = -(_e6);
let _e8 = entryPointOutput_u002e_clip;
let _e9 = entryPointOutput_u002e_sigmas;
let _e10 = entryPointOutput_u002e_colour;
return VertexOutput(_e8, _e9, _e10);
}
` },
  SplatFragment: { bindings: {"parameters": 0}, parameters: {"GsacModel0": 0, "GsacModel1": 16, "GsacModel2": 32, "GsacBlend": 48, "GsacKeepsEnergy": 64, "GsacIndexBits": 68, "PageView0": 80, "PageView1": 96, "PageView2": 112, "PageLens": 128, "PageDisc": 144, "PageInk": 160}, code: `
struct u0024_Global {
GsacModel0_: vec4<f32>,
GsacModel1_: vec4<f32>,
GsacModel2_: vec4<f32>,
GsacBlend: vec4<f32>,
GsacKeepsEnergy: u32,
GsacIndexBits: u32,
PageView0_: vec4<f32>,
PageView1_: vec4<f32>,
PageView2_: vec4<f32>,
PageLens: vec4<f32>,
PageDisc: vec4<f32>,
PageInk: vec4<f32>,
}

@group(0) @binding(0)
var<uniform> unnamed: u0024_Global;
var<private> input_u002e_sigmas_1: vec2<f32>;
var<private> input_u002e_colour_1: vec4<f32>;
var<private> entryPointOutput: vec4<f32>;

fn SplatFragment_1() {
let _e7 = input_u002e_sigmas_1;
let _e8 = input_u002e_colour_1;
let _e10 = unnamed.GsacBlend;
let _e17 = min(_e10.y, (_e8.w * exp((-0.5f * dot(_e7, _e7)))));
if ((_e17 - _e10.z) < 0f) {
discard;
}
let _e22 = (_e8.xyz * _e17);
entryPointOutput = vec4<f32>(_e22.x, _e22.y, _e22.z, _e17);
return;
}

@fragment
fn SplatFragment(@location(0) input_u002e_sigmas: vec2<f32>, @location(1) @interpolate(flat) input_u002e_colour: vec4<f32>) -> @location(0) vec4<f32> {
input_u002e_sigmas_1 = input_u002e_sigmas;
input_u002e_colour_1 = input_u002e_colour;
SplatFragment_1();
let _e5 = entryPointOutput;
return _e5;
}
` },
  FloorVertex: { bindings: {"parameters": 0}, parameters: {"GsacModel0": 0, "GsacModel1": 16, "GsacModel2": 32, "GsacBlend": 48, "GsacKeepsEnergy": 64, "GsacIndexBits": 68, "PageView0": 80, "PageView1": 96, "PageView2": 112, "PageLens": 128, "PageDisc": 144, "PageInk": 160}, code: `
struct u0024_Global {
GsacModel0_: vec4<f32>,
GsacModel1_: vec4<f32>,
GsacModel2_: vec4<f32>,
GsacBlend: vec4<f32>,
GsacKeepsEnergy: u32,
GsacIndexBits: u32,
PageView0_: vec4<f32>,
PageView1_: vec4<f32>,
PageView2_: vec4<f32>,
PageLens: vec4<f32>,
PageDisc: vec4<f32>,
PageInk: vec4<f32>,
}

struct VertexOutput {
@builtin(position) member: vec4<f32>,
@location(0) member_1: vec2<f32>,
}

@group(0) @binding(0)
var<uniform> unnamed: u0024_Global;
var<private> vertex_1: u32;
var<private> entryPointOutput_u002e_clip: vec4<f32> = vec4<f32>(0f, 0f, 0f, 1f);
var<private> entryPointOutput_u002e_place: vec2<f32>;

fn FloorVertex_1() {
let _e20 = vertex_1;
let _e23 = select(-1f, 1f, ((_e20 & 1u) != 0u));
let _e26 = select(-1f, 1f, ((_e20 & 2u) != 0u));
let _e30 = unnamed.PageDisc[0u];
let _e33 = unnamed.PageDisc[3u];
let _e37 = unnamed.PageDisc[1u];
let _e40 = unnamed.PageDisc[2u];
let _e43 = unnamed.PageDisc[3u];
let _e47 = unnamed.PageView0_;
let _e49 = unnamed.PageView1_;
let _e51 = unnamed.PageView2_;
let _e56 = unnamed.PageLens[0u];
let _e59 = unnamed.PageLens[2u];
let _e62 = unnamed.PageLens[1u];
let _e66 = unnamed.PageLens[3u];
entryPointOutput_u002e_clip = ((vec4<f32>(fma(_e23, _e33, _e30), _e37, fma(_e26, _e43, _e40), 1f) * mat4x4<f32>(_e47, _e49, _e51, vec4<f32>(0f, 0f, 0f, 1f))) * mat4x4<f32>(vec4<f32>(_e56, 0f, _e59, 0f), vec4<f32>(0f, -(_e62), -(_e66), 0f), vec4<f32>(0f, 0f, -1f, -0.02f), vec4<f32>(0f, 0f, -1f, 0f)));
entryPointOutput_u002e_place = vec2<f32>(_e23, _e26);
return;
}

@vertex
fn FloorVertex(@builtin(vertex_index) vertex: u32) -> VertexOutput {
vertex_1 = vertex;
FloorVertex_1();
let _e5 = entryPointOutput_u002e_clip.y;
entryPointOutput_u002e_clip.y = -(_e5);
let _e7 = entryPointOutput_u002e_clip;
let _e8 = entryPointOutput_u002e_place;
return VertexOutput(_e7, _e8);
}
` },
  FloorFragment: { bindings: {"parameters": 0}, parameters: {"GsacModel0": 0, "GsacModel1": 16, "GsacModel2": 32, "GsacBlend": 48, "GsacKeepsEnergy": 64, "GsacIndexBits": 68, "PageView0": 80, "PageView1": 96, "PageView2": 112, "PageLens": 128, "PageDisc": 144, "PageInk": 160}, code: `
struct u0024_Global {
GsacModel0_: vec4<f32>,
GsacModel1_: vec4<f32>,
GsacModel2_: vec4<f32>,
GsacBlend: vec4<f32>,
GsacKeepsEnergy: u32,
GsacIndexBits: u32,
PageView0_: vec4<f32>,
PageView1_: vec4<f32>,
PageView2_: vec4<f32>,
PageLens: vec4<f32>,
PageDisc: vec4<f32>,
PageInk: vec4<f32>,
}

@group(0) @binding(0)
var<uniform> unnamed: u0024_Global;
var<private> input_u002e_place_1: vec2<f32>;
var<private> entryPointOutput: vec4<f32>;

fn FloorFragment_1() {
let _e7 = input_u002e_place_1;
let _e10 = smoothstep(0f, 1f, (1f - length(_e7)));
let _e13 = unnamed.PageInk[2u];
entryPointOutput = vec4<f32>(0f, 0f, 0f, ((_e13 * _e10) * _e10));
return;
}

@fragment
fn FloorFragment(@location(0) input_u002e_place: vec2<f32>) -> @location(0) vec4<f32> {
input_u002e_place_1 = input_u002e_place;
FloorFragment_1();
let _e3 = entryPointOutput;
return _e3;
}
` },
};
