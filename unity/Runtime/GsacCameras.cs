using System;
using System.Collections.Generic;
using UnityEngine;
using UnityEngine.Rendering;

namespace Gsac
{
    /// <summary>
    /// Has the avatars drawn for each camera just before it culls, in every render pipeline: for the game's and the editor's
    /// cameras, for probes and recorders, and for a camera that a script renders by hand.
    /// </summary>
    public static class GsacCameras
    {
        static readonly List<GsacRenderer> Renderers = new List<GsacRenderer>();
        static Material material, own, trained;

        /// <summary>Whether a camera shows an object of its layers; null: all do. The editor's prefab stages and hidden objects are told by it.</summary>
        public static Func<Camera, GameObject, bool> Shows;

        /// <summary>The splats' material, shared by all avatars that have none of their own.</summary>
        public static Material Material
        {
            get { return Made(ref material, "Gsac/GsacSplats"); }
        }

        /// <summary>What draws an avatar's own picture, and what lays it over the scene.</summary>
        internal static Material OwnMaterial
        {
            get { return Made(ref own, "Gsac/GsacOwn"); }
        }

        internal static Material TrainedMaterial
        {
            get { return Made(ref trained, "Gsac/GsacTrained"); }
        }

        static Material Made(ref Material material, string shader)
        {
            if (material == null) Make(ref material, shader);
            return material;
        }

        static void Make(ref Material material, string shader)
        {
            material = new Material(Resources.Load<Shader>(shader)) { hideFlags = HideFlags.HideAndDontSave };
        }

        internal static void Add(GsacRenderer renderer)
        {
            if (Renderers.Count == 0)
            {
                Camera.onPreCull += Draw;
                RenderPipelineManager.beginCameraRendering += Draw;
            }
            Renderers.Add(renderer);
        }

        internal static void Remove(GsacRenderer renderer)
        {
            if (!Renderers.Remove(renderer) || Renderers.Count > 0) return;
            Camera.onPreCull -= Draw;
            RenderPipelineManager.beginCameraRendering -= Draw;
            Free(material);
            Free(own);
            Free(trained);
            material = own = trained = null;
        }

        /// <summary>Destroys what was made at run time, or in the editor while nothing plays.</summary>
        internal static void Free(UnityEngine.Object made)
        {
            if (made == null) return;
            if (Application.isPlaying) UnityEngine.Object.Destroy(made);
            else UnityEngine.Object.DestroyImmediate(made);
        }

        static void Draw(ScriptableRenderContext context, Camera camera)
        {
            Draw(camera);
        }

        static void Draw(Camera camera)
        {
            for (int i = 0; i < Renderers.Count; i++)
            {
                GameObject person = Renderers[i].gameObject;
                if ((camera.cullingMask & (1 << person.layer)) == 0 || Shows != null && !Shows(camera, person)) continue;
                Renderers[i].Draw(camera);
            }
        }
    }
}
