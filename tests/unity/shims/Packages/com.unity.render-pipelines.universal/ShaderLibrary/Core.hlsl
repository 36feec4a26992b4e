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
