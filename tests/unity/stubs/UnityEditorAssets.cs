// Stands for the project's files and for builds in Unity's editor. API.md: pages and versions.
using System;
using System.Collections.Generic;

namespace UnityEditor
{
    using UnityEngine;

    [Flags] public enum GizmoType { Pickable = 1, NonSelected = 32, Selected = 4 }

    [AttributeUsage(AttributeTargets.Method)] public sealed class DrawGizmo : Attribute { public DrawGizmo(GizmoType gizmo) { } }

    [AttributeUsage(AttributeTargets.Method)] public sealed class MenuItem : Attribute { public MenuItem(string itemName) { } }

    public static class AssetDatabase
    {
        /// <summary>Not Unity's: path -> main object, as the project has them.</summary>
        public static readonly Dictionary<string, Object> Project = new Dictionary<string, Object>();
        public static string[] FindAssets(string filter) { return new List<string>(Project.Keys).ConvertAll(path => "guid of " + path).ToArray(); }
        public static string GUIDToAssetPath(string guid) { return guid.Substring("guid of ".Length); }
        public static T LoadAssetAtPath<T>(string assetPath) where T : Object
        {
            Object found;
            return Project.TryGetValue(assetPath, out found) ? found as T : null;
        }
    }
}

namespace UnityEditor.Build
{
    using UnityEditor.Build.Reporting;
    using UnityEngine.SceneManagement;

    public interface IOrderedCallback
    {
        int callbackOrder { get; }
    }

    public interface IProcessSceneWithReport : IOrderedCallback
    {
        void OnProcessScene(Scene scene, BuildReport report);
    }
}

namespace UnityEditor.Build.Reporting
{
    public sealed class BuildReport : UnityEngine.Object
    {
    }
}
