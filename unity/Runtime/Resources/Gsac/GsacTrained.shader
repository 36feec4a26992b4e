// For projects with linear colours: lays the avatar's own picture, which GsacOwn.shader drew in display colours, over the scene among
// the transparent things; one SubShader a render pipeline. What lies behind is taken from a copy where the pipeline has one.
Shader "Gsac/Trained"
{
    SubShader
    {
        PackageRequirements { "com.unity.render-pipelines.high-definition": "12.0.0" }
        Tags { "RenderPipeline" = "HDRenderPipeline" "RenderType" = "Transparent" "Queue" = "Transparent" }
        Pass
        {
            Name "Gsac"
            Tags { "LightMode" = "ForwardOnly" }
            ZWrite Off
            ZTest LEqual
            Cull Off
            Blend One OneMinusSrcAlpha

            HLSLPROGRAM
            #pragma target 4.5
            #pragma vertex Vertex
            #pragma fragment Fragment
            #pragma multi_compile_instancing
            #include "Packages/com.unity.render-pipelines.core/ShaderLibrary/Common.hlsl"
            #include "Packages/com.unity.render-pipelines.high-definition/Runtime/ShaderLibrary/ShaderVariables.hlsl"
            #include "GsacFogHighDefinition.hlsl"
            // HDRP's world is relative to the camera
            #define GSAC_ORIGIN (-GetCameraRelativePositionWS(float3(0, 0, 0)))
            #include "GsacTrained.hlsl"

            uint GsacBehindIsCopied; // 1: for this camera; what lies in the texture is another frame's otherwise

            GsacLaidPixel Fragment(GsacLaidVaryings input)
            {
                UNITY_SETUP_STEREO_EYE_INDEX_POST_VERTEX(input);
                // after opaque things, sky and fog; in this frame's exposure, as all that is drawn here
                float4 behind = float4(LoadCameraColor((uint2)input.clip.xy, 0), 1);
                return GsacLay(input, UNITY_MATRIX_P, behind, GsacBehindIsCopied ? _ScreenSize.xy : float2(0, 0));
            }
            ENDHLSL
        }
    }

    SubShader
    {
        PackageRequirements { "com.unity.render-pipelines.universal": "12.0.0" }
        Tags { "RenderPipeline" = "UniversalPipeline" "RenderType" = "Transparent" "Queue" = "Transparent" }
        Pass
        {
            Name "Gsac"
            Tags { "LightMode" = "UniversalForward" }
            ZWrite Off
            ZTest LEqual
            Cull Off
            Blend One OneMinusSrcAlpha

            HLSLPROGRAM
            #pragma target 4.5
            #pragma vertex Vertex
            #pragma fragment Fragment
            #pragma multi_compile_instancing
            #pragma multi_compile_fog
            #include "Packages/com.unity.render-pipelines.universal/ShaderLibrary/Core.hlsl"
            #define GSAC_FOGGED(colour, clip) MixFog(colour, ComputeFogFactor((clip).z))
            #define GSAC_ORIGIN float3(0, 0, 0)
            #include "GsacTrained.hlsl"

            GsacCopy _CameraOpaqueTexture;

            GsacLaidPixel Fragment(GsacLaidVaryings input)
            {
                UNITY_SETUP_STEREO_EYE_INDEX_POST_VERTEX(input);
                float2 size;
                float4 behind = GsacCopied(_CameraOpaqueTexture, input.clip.xy / _ScaledScreenParams.xy, size);
                return GsacLay(input, UNITY_MATRIX_P, behind, size);
            }
            ENDHLSL
        }
    }

    SubShader
    {
        Tags { "RenderType" = "Transparent" "Queue" = "Transparent" }
        GrabPass { "GsacBehind" }
        Pass
        {
            Name "Gsac"
            ZWrite Off
            ZTest LEqual
            Cull Off
            Blend One OneMinusSrcAlpha

            HLSLPROGRAM
            #pragma target 4.5
            #pragma vertex Vertex
            #pragma fragment Fragment
            #pragma multi_compile_instancing
            #pragma multi_compile_fog
            #include "UnityCG.cginc"
            #include "GsacFogBuiltIn.hlsl"
            #define GSAC_ORIGIN float3(0, 0, 0)
            #include "GsacTrained.hlsl"

            GsacCopy GsacBehind;

            GsacLaidPixel Fragment(GsacLaidVaryings input)
            {
                UNITY_SETUP_STEREO_EYE_INDEX_POST_VERTEX(input);
                float2 size;
                float4 behind = GsacCopied(GsacBehind, input.clip.xy / _ScreenParams.xy, size);
                return GsacLay(input, UNITY_MATRIX_P, behind, size);
            }
            ENDHLSL
        }
    }
}
