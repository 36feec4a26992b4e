// Stands for URP's file of this name in the tests.
#include "UnityCG.cginc"
float4 _ScaledScreenParams;
#ifdef FOG_EXP2
float ComputeFogFactor(float z) { return unity_FogParams.x * max(z, 0); }
float3 MixFog(float3 colour, float factor) { return lerp(unity_FogColor.rgb, colour, saturate(exp2(-factor * factor))); }
#else
float ComputeFogFactor(float z) { return 0; }
float3 MixFog(float3 colour, float factor) { return colour; }
#endif
#ifdef MESH
#define UNITY_NEAR_CLIP_VALUE 0
float4x4 unity_MatrixPreviousM;
float4x4 _NonJitteredViewProjMatrix;
float4x4 _PrevViewProjMatrix;
float4 unity_MotionVectorsParams;
float3 TransformObjectToWorld(float3 place) { return mul(unity_ObjectToWorld, float4(place, 1)).xyz; }
float3 TransformObjectToWorldNormal(float3 normal) { return normal; }
float4 TransformWorldToHClip(float3 place) { return mul(UNITY_MATRIX_VP, float4(place, 1)); }
#endif
