// Draws the sorted gaussians as one indexed draw among the transparent things; one SubShader a render pipeline.
Shader "Gsac/Splats"
{
    Properties
    {
        _Stencil ("Stencil reference", Float) = 0
        [Enum(UnityEngine.Rendering.CompareFunction)] _StencilComp ("Stencil comparison", Float) = 8
        [Enum(UnityEngine.Rendering.StencilOp)] _StencilOp ("Stencil operation", Float) = 0
        _StencilReadMask ("Stencil read mask", Float) = 255
        _StencilWriteMask ("Stencil write mask", Float) = 255
        [Enum(UnityEngine.Rendering.CompareFunction)] _ZTest ("Depth test", Float) = 4
    }

    SubShader
    {
        PackageRequirements { "com.unity.render-pipelines.high-definition": "12.0.0" }
        Tags { "RenderPipeline" = "HDRenderPipeline" "RenderType" = "Transparent" "Queue" = "Transparent" }
        Pass
        {
            Name "Gsac"
            Tags { "LightMode" = "ForwardOnly" }
            ZWrite Off
            ZTest [_ZTest]
            Stencil
            {
                Ref [_Stencil]
                Comp [_StencilComp]
                Pass [_StencilOp]
                ReadMask [_StencilReadMask]
                WriteMask [_StencilWriteMask]
            }
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
            #define GSAC_SCREEN _ScreenSize.xy
            // HDRP's world is relative to the camera
            #define GSAC_ORIGIN (-GetCameraRelativePositionWS(float3(0, 0, 0)))
            #include "GsacPass.hlsl"
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
            ZTest [_ZTest]
            Stencil
            {
                Ref [_Stencil]
                Comp [_StencilComp]
                Pass [_StencilOp]
                ReadMask [_StencilReadMask]
                WriteMask [_StencilWriteMask]
            }
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
            #define GSAC_SCREEN _ScaledScreenParams.xy
            #define GSAC_ORIGIN float3(0, 0, 0)
            #include "GsacPass.hlsl"
            ENDHLSL
        }
    }

    SubShader
    {
        Tags { "RenderType" = "Transparent" "Queue" = "Transparent" }
        Pass
        {
            Name "Gsac"
            ZWrite Off
            ZTest [_ZTest]
            Stencil
            {
                Ref [_Stencil]
                Comp [_StencilComp]
                Pass [_StencilOp]
                ReadMask [_StencilReadMask]
                WriteMask [_StencilWriteMask]
            }
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
            #define GSAC_SCREEN _ScreenParams.xy
            #define GSAC_ORIGIN float3(0, 0, 0)
            #include "GsacPass.hlsl"
            ENDHLSL
        }
    }
}
